//! The picture of a view: nothing here knows of time, motors or a terminal.

use super::keys::{Page, Ui};
use super::view::{POINTS, Strip, View};
use crate::snapshot::{self, Motor};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{Axis, Block, Chart, Dataset, GraphType, Paragraph, Row, Table};

const KEYS: &str = "Shift-A arm  SPACE STOP ALL  ↑↓ motor  ←→ jog  0 still  s sine  e steps  t tune  i identify  g gains  r record  b bus  ? help  q quit";

const HELP: [&str; 21] = [
    "Shift-A       arm: all motors have to be heard. Lift the wheels first",
    "Space, Esc    stop everything: zeros until they are seen on the bus",
    "↑ ↓           choose a motor",
    "← →           its speed, 10 rpm less or more; with Shift 100 rpm",
    "0             its speed is zero",
    "s             a sine of 60 rpm and 2 s",
    "e             steps of 60 rpm, each second",
    "g             its gains: kp,ki,kd and Enter; they count at once",
    "t             tune: a step, a relay, gains by a rule, a step",
    "i             identify: friction, inertia and delay by ten seconds of swings; the gains stay",
    "r             record to session-N.mcap and session-N.log, or end that",
    "b             the ids on the bus, with a guess of those that are unknown",
    "x             the motor falls silent for 1 s (simulator)",
    ". :           0.1 s or 1 s more of a simulator that stands (--held)",
    "q, Ctrl-C     end, with zeros",
    "",
    "What is red needs you: an armed robot, a fault, a motor that is not heard.",
    "Gains are of the speed loop: A, V or Nm per rad/s, and per rad.",
    "When one motor is lost, all stop. Arm again with Shift-A.",
    "Results of t and i stand in the log, and are printed as TOML at the end.",
    "Without a window: drivetrain-bench --help",
];

const ALARM: Style = Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD);
const CALM: Style = Style::new().fg(Color::Black).bg(Color::Gray);

/// Draws a view.
pub(crate) fn draw(frame: &mut Frame<'_>, view: &View, ui: &Ui) {
    let motors = u16::try_from(view.snapshot.motors.len()).unwrap_or(u16::MAX);
    let [title, middle, log, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(8),
        Constraint::Length(9),
        Constraint::Length(2),
    ])
    .areas(frame.area());
    draw_title(frame, title, view);
    match ui.page {
        Page::Motors => {
            let room = Constraint::Length(motors.saturating_add(3).min(middle.height / 2));
            let [table, chart] = Layout::vertical([room, Constraint::Min(5)]).areas(middle);
            draw_motors(frame, table, view, ui);
            draw_strip(frame, chart, view, ui);
        }
        Page::Bus => draw_bus(frame, middle, view),
        Page::Help => {
            let lines: Vec<Line<'_>> = HELP.into_iter().map(Line::from).collect();
            frame.render_widget(
                Paragraph::new(lines).block(Block::bordered().title("keys")),
                middle,
            );
        }
    }
    draw_log(frame, log, view);
    draw_keys(frame, keys, ui);
}

fn draw_title(frame: &mut Frame<'_>, area: Rect, view: &View) {
    let snapshot = &view.snapshot;
    let style = if snapshot.is_sending { ALARM } else { CALM };
    let refusal = match &snapshot.refusal {
        Some(refusal) if snapshot.is_sending => format!(" ({refusal})"),
        _ => String::new(),
    };
    let recording = if snapshot.is_recording { "  REC" } else { "" };
    let held = if view.is_held { "  stands" } else { "" };
    let text = format!(
        " drivetrain bench  {}  {}{refusal}  load {:.1} %  {:.1} s{held}{recording}",
        snapshot.link,
        snapshot.stage,
        100.0 * snapshot.load,
        snapshot.seconds
    );
    frame.render_widget(Paragraph::new(text).style(style), area);
}

fn draw_motors(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let rows = view.snapshot.motors.iter().enumerate().map(|(index, motor)| {
        let row = Row::new(cells(motor, index == ui.selected));
        let is_wrong = motor.error.is_some() || !motor.conditions.is_empty();
        let style = match (is_wrong, motor.is_armed) {
            (true, _) => Style::new().fg(Color::Red),
            (false, true) => Style::new().fg(Color::Green),
            (false, false) => Style::new(),
        };
        row.style(if index == ui.selected { style.add_modifier(Modifier::BOLD) } else { style })
    });
    let widths = [2, 20, 9, 8, 8, 10, 10, 5, 6, 16].map(Constraint::Length);
    let widths = widths.into_iter().chain([Constraint::Min(10)]);
    let header =
        ["", "motor", "link", "target", "rpm", "turns", "effort", "°C", "Hz", "does", "conditions"];
    let table =
        Table::new(rows, widths).header(Row::new(header)).block(Block::bordered().title("motors"));
    frame.render_widget(table, area);
}

fn cells(motor: &Motor, is_selected: bool) -> [String; 11] {
    let or_dash = |text: Option<String>| text.unwrap_or("-".into());
    let mut wrong: Vec<&str> = motor.conditions.clone();
    wrong.extend(motor.error.as_deref());
    [
        if is_selected { ">".into() } else { String::new() },
        motor.name.clone(),
        if motor.is_heard { format!("{:?}", motor.link) } else { "not heard".into() },
        or_dash(motor.target_rpm.map(|rpm| fixed(rpm, 1))),
        if motor.is_heard { fixed(motor.rpm, 1) } else { "-".into() },
        or_dash(motor.turns.map(|turns| format!("{turns:.2}"))),
        or_dash(motor.effort.map(|effort| format!("{} {}", fixed(effort, 2), motor.measured_unit))),
        or_dash(motor.temperature_c.map(|degrees| degrees.to_string())),
        motor.feedback_hz.to_string(),
        if motor.is_armed { motor.program.clone() } else { "relaxed".into() },
        wrong.join(", "),
    ]
}

/// A number with so many places, and without the sign of a zero.
fn fixed(value: f32, places: usize) -> String {
    let text = format!("{value:.places$}");
    let is_zero = !text.contains(|sign: char| ('1'..='9').contains(&sign));
    if is_zero { text.trim_start_matches('-').to_owned() } else { text }
}

/// A number with so many places at most.
fn short(value: f32, places: usize) -> String {
    let text = fixed(value, places);
    text.trim_end_matches('0').trim_end_matches('.').to_owned()
}

fn draw_strip(frame: &mut Frame<'_>, area: Rect, view: &View, ui: &Ui) {
    let nothing = Strip::default();
    let strip = view.strips.get(ui.selected).unwrap_or(&nothing);
    let motor = view.snapshot.motors.get(ui.selected);
    let (name, gains) = motor.map_or((String::new(), String::new()), |motor| {
        let (kp, ki, kd) = motor.gains;
        let [kp, ki, kd] = [kp, ki, kd].map(|gain| short(gain, 3));
        (
            motor.name.clone(),
            format!("kp {kp} {unit} per rad/s  ki {ki} {unit} per rad  kd {kd}", unit = motor.unit),
        )
    });
    let title = Line::from(vec![
        Span::raw(format!("{name}, rpm: ")),
        Span::styled("target", Style::new().fg(Color::Red)),
        Span::raw(" and "),
        Span::styled("measured", Style::new().fg(Color::Cyan)),
        Span::raw(format!("   {gains}")),
    ]);
    let (measured, target): (Vec<_>, Vec<_>) =
        (strip.measured.iter().copied().collect(), strip.target.iter().copied().collect());
    let values = measured.iter().chain(&target).map(|(_, rpm)| *rpm);
    let highest = values.fold(20.0_f64, |highest, rpm| highest.max(rpm.abs())) * 1.1;
    let end = f64::from(view.snapshot.seconds);
    let start = end - 0.05 * POINTS as f64;
    let line = |points, colour| {
        let data = Dataset::default().marker(Marker::Braille).graph_type(GraphType::Line);
        data.style(Style::new().fg(colour)).data(points)
    };
    let label = |rpm: f64| format!("{rpm:6.0}");
    let chart = Chart::new(vec![line(&target, Color::Red), line(&measured, Color::Cyan)])
        .block(Block::bordered().title(title))
        .x_axis(Axis::default().bounds([start, end]).labels(["-10 s", "now"]))
        .y_axis(Axis::default().bounds([-highest, highest]).labels([
            label(-highest),
            label(0.0),
            label(highest),
        ]));
    frame.render_widget(chart, area);
}

fn draw_bus(frame: &mut Frame<'_>, area: Rect, view: &View) {
    let room = usize::from(area.height.saturating_sub(3));
    let lines = view.snapshot.rows.iter().take(room).map(|row| {
        let style = if row.is_known { Style::new() } else { Style::new().fg(Color::Yellow) };
        Line::from(snapshot::row(row)).style(style)
    });
    let counts = view.snapshot.counts.iter().filter(|(_, count)| *count > 0);
    let counts: Vec<_> = counts.map(|(name, count)| format!("{name} {count}")).collect();
    let title = format!("bus: {}", counts.join("  "));
    let lines: Vec<_> = lines.collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title(title)), area);
}

fn draw_log(frame: &mut Frame<'_>, area: Rect, view: &View) {
    let room = usize::from(area.height.saturating_sub(2));
    let skipped = view.log.len().saturating_sub(room);
    let lines: Vec<_> =
        view.log.iter().skip(skipped).map(|line| Line::from(line.as_str())).collect();
    frame.render_widget(Paragraph::new(lines).block(Block::bordered().title("log")), area);
}

fn draw_keys(frame: &mut Frame<'_>, area: Rect, ui: &Ui) {
    let (text, style) = match (&ui.input, &ui.hint) {
        (Some(input), hint) => {
            let hint = hint.as_deref().unwrap_or("Enter sets; Space and Esc stop everything");
            (format!("kp,ki,kd: {input}_   {hint}"), Style::new().add_modifier(Modifier::BOLD))
        }
        (None, Some(hint)) => (hint.clone(), Style::new().fg(Color::Yellow)),
        (None, None) => (KEYS.into(), Style::new().fg(Color::DarkGray)),
    };
    let paragraph = Paragraph::new(text).style(style).wrap(ratatui::widgets::Wrap { trim: true });
    frame.render_widget(paragraph, area);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot::Snapshot;
    use drivetrain::motor::Link;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use std::collections::VecDeque;

    fn view(is_armed: bool) -> View {
        let motor = Motor {
            name: "M3508 #1".into(),
            link: Link::Online,
            is_armed,
            is_heard: true,
            rpm: 59.7,
            turns: Some(12.345),
            effort: Some(0.5),
            measured_unit: "A",
            temperature_c: Some(33),
            error: None,
            conditions: vec!["late"],
            feedback_hz: 1_000,
            target_rpm: Some(60.0),
            program: "speed".into(),
            gains: (1.9, 2.4, 0.0),
            unit: "A",
        };
        let stage = if is_armed { "ARMED" } else { "listening, nothing is sent" };
        let snapshot = Snapshot {
            seconds: 10.0,
            link: "can0".into(),
            stage,
            is_sending: is_armed,
            refusal: None,
            load: 0.25,
            counts: vec![("received", 7), ("sent", 0)],
            rows: Vec::new(),
            motors: vec![motor],
            is_recording: true,
        };
        let mut strip = Strip::default();
        (0..200).for_each(|point| strip.push(0.05 * f64::from(point), 59.7, Some(60.0)));
        let log = VecDeque::from(["    1.00 s  something happened".to_owned()]);
        View { snapshot, strips: vec![strip], log, is_held: false }
    }

    fn screen(view: &View, ui: &Ui, (width, height): (u16, u16)) -> String {
        let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
        terminal.draw(|frame| draw(frame, view, ui)).unwrap();
        terminal.backend().to_string()
    }

    #[test]
    fn the_picture_is_a_function_of_the_view() {
        let (view, ui) = (view(true), Ui::default());
        let text = screen(&view, &ui, (140, 36));
        assert_eq!(text, screen(&view, &ui, (140, 36)));
        for words in [
            "can0",
            "ARMED",
            "load 25.0 %",
            "REC",
            "> ",
            "M3508 #1",
            "60.0",
            "59.7",
            "12.3",
            "0.50 A",
            "33",
            "speed",
            "late",
            "kp 1.9 A per rad/s",
            "something happened",
            "SPACE STOP ALL",
        ] {
            assert!(text.contains(words), "{words} not in\n{text}");
        }
    }

    #[test]
    fn each_page_is_drawn_on_a_screen_of_any_size() {
        for page in [Page::Motors, Page::Bus, Page::Help] {
            for size in [(1, 1), (10, 3), (80, 24), (300, 100)] {
                screen(&view(false), &Ui { page, selected: 9, ..Ui::default() }, size);
            }
        }
        let text = screen(&view(false), &Ui { page: Page::Bus, ..Ui::default() }, (140, 36));
        assert!(text.contains("received 7") && !text.contains("sent 0"), "{text}");
    }

    #[test]
    fn numbers_have_no_sign_at_zero_and_no_zeros_at_the_end() {
        assert_eq!([fixed(-0.001, 2), fixed(-0.5, 1), fixed(12.0, 1)], ["0.00", "-0.5", "12.0"]);
        assert_eq!([short(1.9, 3), short(36.110_233, 3), short(0.0, 3)], ["1.9", "36.11", "0"]);
    }
}
