//! The picture of a view: nothing here knows of time, motors or a terminal.

use super::keys::{Page, Ui};
use super::view::{POINTS, Strip, View};
use crate::snapshot::{self, Motor};
use ratatui::Frame;
use ratatui::layout::{Constraint, Layout, Rect};
use ratatui::style::{Color, Modifier, Style};
use ratatui::symbols::Marker;
use ratatui::text::{Line, Span};
use ratatui::widgets::{
    Axis, Block, Chart, Dataset, GraphType, Paragraph, Row, Table, TableState, Wrap,
};

const KEYS: &str = "Shift-A arm  SPACE STOP ALL  ↑↓ motor  ←→ jog  0 still  s sine  e steps  t tune  i identify  g gains  b bus  ? all keys";

/// On 80 columns and 24 lines, all of it is on the screen.
const HELP: [&str; 19] = [
    "Shift-A     arm: all motors have to be heard. Lift the wheels first",
    "Space, Esc  stop everything: zeros until they are seen on the bus",
    "↑ ↓         choose a motor",
    "← →         its speed, 10 rpm less or more; with Shift 100 rpm",
    "0           its speed is zero",
    "s, e        a sine of 60 rpm and 2 s; steps of 60 rpm, each second",
    "g           its gains: kp,ki,kd and Enter; they count at once",
    "t           tune: a step, a relay, gains by a rule, a step. The gains count",
    "i           identify: friction, inertia, delay by ten seconds of swings",
    "r           record to session-N.mcap and session-N.log, or end that",
    "b           the ids on the bus, with a guess of those that are unknown",
    "x           the motor falls silent for 1 s (simulator)",
    "p           plays a recording once more (--replay)",
    ". :         0.1 s or 1 s more of a simulator that stands (--held)",
    "q, Ctrl-C   end, with zeros",
    "An armed robot, a fault and a silent motor are red; a drive that speaks",
    "only when it is asked is idle until then. One lost motor stops all.",
    "Gains are of the speed loop: A, V or Nm per rad/s, and per rad. Results of",
    "t and i are printed as TOML at the end. Commands: drivetrain-bench --help",
];

/// Of a window with fewer lines, the log gives some to the motors.
const LOW: u16 = 32;

/// A window with fewer columns has no room for turns and rate, and shows conditions in the place of the program.
const WIDE: u16 = 116;

const ALARM: Style = Style::new().fg(Color::White).bg(Color::Red).add_modifier(Modifier::BOLD);
const CALM: Style = Style::new().fg(Color::Black).bg(Color::Gray);

/// Draws a view.
pub(crate) fn draw(frame: &mut Frame<'_>, view: &View, ui: &Ui) {
    let motors = u16::try_from(view.snapshot.motors.len()).unwrap_or(u16::MAX);
    let log_room = match (frame.area().height < LOW, ui.page) {
        (true, Page::Help) => 0,
        (true, _) => 4,
        (false, _) => 9,
    };
    let [title, middle, log, keys] = Layout::vertical([
        Constraint::Length(1),
        Constraint::Min(8),
        Constraint::Length(log_room),
        Constraint::Length(2),
    ])
    .areas(frame.area());
    draw_title(frame, title, view);
    match ui.page {
        Page::Motors => {
            let most = middle.height.saturating_sub(5);
            let room = Constraint::Length(motors.saturating_add(3).min(most));
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
    let is_wide = area.width >= WIDE;
    let kept = |column: usize| is_wide || !matches!(column, 5 | 8 | 10);
    let rows = view.snapshot.motors.iter().enumerate().map(|(index, motor)| {
        let mut cells = cells(motor, index == ui.selected);
        if !is_wide && !cells[10].is_empty() {
            cells.swap(9, 10);
        }
        let cells = cells.into_iter().enumerate().filter(|(column, _)| kept(*column));
        let row = Row::new(cells.map(|(_, cell)| cell));
        let is_wrong = motor.error.is_some() || !motor.conditions.is_empty();
        let style = match (is_wrong, motor.is_armed) {
            (true, _) => Style::new().fg(Color::Red),
            (false, true) => Style::new().fg(Color::Green),
            (false, false) => Style::new(),
        };
        row.style(if index == ui.selected { style.add_modifier(Modifier::BOLD) } else { style })
    });
    let (lengths, last): (&[u16], u16) = if is_wide {
        (&[2, 20, 9, 8, 8, 10, 10, 5, 6, 16], 10)
    } else {
        (&[1, 19, 9, 7, 7, 9, 3], 0)
    };
    let widths = lengths.iter().map(|length| Constraint::Length(*length));
    let widths = widths.chain([Constraint::Min(last)]);
    let header =
        ["", "motor", "link", "target", "rpm", "turns", "effort", "°C", "Hz", "does", "conditions"];
    let header = header.into_iter().enumerate().filter(|(column, _)| kept(*column));
    let header = Row::new(header.map(|(_, name)| name));
    let table = Table::new(rows, widths).header(header).block(Block::bordered().title("motors"));
    // Scrolls as far as the chosen motor.
    let mut state = TableState::new().with_selected(ui.selected);
    frame.render_stateful_widget(table, area, &mut state);
}

fn cells(motor: &Motor, is_selected: bool) -> [String; 11] {
    let or_dash = |text: Option<String>| text.unwrap_or("-".into());
    let mut wrong: Vec<&str> = motor.conditions.clone();
    wrong.extend(motor.error.as_deref());
    [
        if is_selected { ">".into() } else { String::new() },
        motor.name.clone(),
        motor.link.clone(),
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
    let nonzero = |counts: &[(&str, u64)]| {
        let counts = counts.iter().filter(|(_, count)| *count > 0);
        let counts: Vec<_> = counts.map(|(name, count)| format!("{name} {count}")).collect();
        if counts.is_empty() { "none".to_owned() } else { counts.join("  ") }
    };
    let head = [
        Line::from(format!("frames: {}", nonzero(&view.snapshot.counts))),
        Line::from(format!("errors: {}", nonzero(&view.snapshot.errors))),
    ];
    let lines = view.snapshot.rows.iter().map(|row| {
        let style = if row.is_known { Style::new() } else { Style::new().fg(Color::Yellow) };
        Line::from(snapshot::row(row)).style(style)
    });
    let lines: Vec<_> = head.into_iter().chain(lines).collect();
    let page = Paragraph::new(lines).wrap(Wrap { trim: false });
    frame.render_widget(page.block(Block::bordered().title("bus")), area);
}

fn draw_log(frame: &mut Frame<'_>, area: Rect, view: &View) {
    let lines: Vec<_> = view.log.iter().map(|line| Line::from(line.as_str())).collect();
    let log = Paragraph::new(lines).wrap(Wrap { trim: false });
    let count = log.line_count(area.width.saturating_sub(2));
    let skipped = count.saturating_sub(area.height.saturating_sub(2).into());
    let log = log.scroll((u16::try_from(skipped).unwrap_or(u16::MAX), 0));
    frame.render_widget(log.block(Block::bordered().title("log")), area);
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
    let paragraph = Paragraph::new(text).style(style).wrap(Wrap { trim: true });
    frame.render_widget(paragraph, area);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::snapshot::Snapshot;
    use ratatui::Terminal;
    use ratatui::backend::TestBackend;
    use std::collections::VecDeque;

    fn view(is_armed: bool) -> View {
        let motor = Motor {
            name: "M3508 #1".into(),
            link: "Online".into(),
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
            errors: vec![("crc", 2), ("stuff", 0)],
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
        assert!(text.contains("frames: received 7 ") && text.contains("errors: crc 2 "), "{text}");
    }

    /// As a terminal opens.
    #[test]
    fn eighty_columns_and_24_lines_have_room_for_eight_motors_and_all_keys() {
        let mut view = view(true);
        let names = (1..=8).map(|id| format!("GM6020 (voltage) #{id}"));
        let of = |name| Motor { name, ..view.snapshot.motors[0].clone() };
        view.snapshot.motors = names.map(of).collect();
        view.snapshot.motors[2].conditions.clear();
        let text = screen(&view, &Ui { selected: 7, ..Ui::default() }, (80, 24));
        for motor in &view.snapshot.motors {
            assert!(text.contains(&motor.name), "{} is not in\n{text}", motor.name);
        }
        for words in [
            "> GM6020 (voltage) #8 Online    60.0    59.7    0.50 A    33  late",
            "  GM6020 (voltage) #3 Online    60.0    59.7    0.50 A    33  speed",
            "something happened",
            "? all keys",
        ] {
            assert!(text.contains(words), "{words} is not in\n{text}");
        }
        // More than there is room for: the table scrolls to the chosen one.
        let more = (9..=20)
            .map(|id| Motor { name: format!("M3508 #{id}"), ..view.snapshot.motors[0].clone() });
        let more: Vec<_> = more.collect();
        view.snapshot.motors.extend(more);
        for (selected, name) in [(0, "GM6020 (voltage) #1"), (11, "M3508 #12"), (19, "M3508 #20")] {
            let text = screen(&view, &Ui { selected, ..Ui::default() }, (80, 24));
            assert!(text.contains(&format!("> {name}")), "{name} is not in\n{text}");
        }
        let help = screen(&view, &Ui { page: Page::Help, ..Ui::default() }, (80, 24));
        for line in HELP {
            assert!(help.contains(line), "{line} is not in\n{help}");
        }
    }

    #[test]
    fn the_keys_have_one_line_of_120_columns_and_the_log_its_last_words() {
        assert!(KEYS.chars().count() <= 120, "{}", KEYS.chars().count());
        let mut view = view(true);
        view.log.push_back("word ".repeat(60) + "and the advice");
        let text = screen(&view, &Ui::default(), (80, 24));
        assert!(text.contains("the advice"), "{text}");
    }

    #[test]
    fn numbers_have_no_sign_at_zero_and_no_zeros_at_the_end() {
        assert_eq!([fixed(-0.001, 2), fixed(-0.5, 1), fixed(12.0, 1)], ["0.00", "-0.5", "12.0"]);
        assert_eq!([short(1.9, 3), short(36.110_233, 3), short(0.0, 3)], ["1.9", "36.11", "0"]);
    }
}
