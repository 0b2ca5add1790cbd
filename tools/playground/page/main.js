const KNOBS = ["switch", "ahead", "left", "turn", "kp", "ki", "delay", "loss"];
const TROUBLES = ["plug", "silence", "second-master", "bus-off", "block"];
const LAYOUTS = ["mecanum", "omni", "differential"], WATCHDOGS = ["program", "both"];
const SLICE_MS = 10;
const $ = (id) => document.getElementById(id);
const bytes = Uint8Array.from(atob(WASM), (c) => c.charCodeAt(0));
const compiled = WebAssembly.compile(bytes);
let language = (navigator.language || "en").startsWith("zh") ? "zh" : "en";
let robot, samples, trail, wasArmed, clock;
const setup = { layout: "mecanum", mass: 20, seed: 1, watchdogs: "program" }, live = { kp: 4, ki: 24, delay: 0, loss: 0, speed: 1 };
const held = new Map();

// A robot is a copy of the module: a new one has a memory of its own.
async function newRobot() {
  const { exports } = await WebAssembly.instantiate(await compiled, {});
  const text = (place) => place ? new TextDecoder().decode(new Uint8Array(exports.memory.buffer, place, exports.text_length())) : "";
  return {
    ...exports,
    why: text(exports.start(setup.seed, LAYOUTS.indexOf(setup.layout), setup.mass, live.kp, live.ki, WATCHDOGS.indexOf(setup.watchdogs))),
    set: (knob, value) => exports.set(KNOBS.indexOf(knob), value),
    log: () => text(exports.take_log()), frames: () => text(exports.frames()), script: () => text(exports.script()),
    hash: () => BigInt.asUintN(64, exports.hash()).toString(16).padStart(16, "0"),
    picture() {
      const place = exports.numbers(), [time, x, y, heading, armed, on, load, ...rest] = new Float32Array(exports.memory.buffer, place, exports.numbers_length());
      const wheels = [];
      for (let i = 0; i + 2 < rest.length; i += 3) wheels.push({ target: rest[i], measured: rest[i + 1], current: rest[i + 2] });
      return { time, x, y, heading, armed: armed > 0, on: on > 0, load, wheels };
    },
  };
}

async function restart() {
  robot = await newRobot();
  samples = []; trail = []; wasArmed = false; clock = undefined;
  $("log").textContent = robot.why ? TEXTS[language].refused(robot.why) + "\n" : "";
  if (robot.why) robot = undefined;
  for (const knob of ["delay", "loss"]) robot?.set(knob, knob === "loss" ? live.loss / 100 : live.delay);
  for (const button of document.querySelectorAll("[data-trouble]")) button.setAttribute("aria-pressed", "false");
  setSwitch(false);
}

function setSwitch(on) {
  $("switch").setAttribute("aria-pressed", on);
  $("switch").textContent = TEXTS[language][on ? "switch_on" : "switch_off"];
  robot?.set("switch", on ? 1 : 0);
}

function steer() {
  const sum = { ahead: 0, left: 0, turn: 0 };
  for (const [axis, sign] of held.values()) sum[axis] += sign;
  robot?.set("ahead", sum.ahead * live.speed); robot?.set("left", sum.left * live.speed); robot?.set("turn", sum.turn * 2.5 * live.speed);
}

function hold(source, what) {
  if (what) held.set(source, what); else held.delete(source);
  steer();
}

// Time of the robot follows that of the page; a page that was hidden catches up with nothing.
function frame(now) {
  requestAnimationFrame(frame);
  if (!robot) return;
  clock ??= now - SLICE_MS;
  if (now - clock > 200) clock = now - SLICE_MS;
  for (; clock + SLICE_MS <= now; clock += SLICE_MS) step(SLICE_MS);
  show();
}

function step(ms) {
  robot.advance(ms);
  const picture = robot.picture();
  samples.push(picture);
  while (samples[0].time < picture.time - 5) samples.shift();
  trail.push([picture.x, picture.y]);
  if (trail.length > 2000) trail.shift();
  wasArmed = picture.on && (wasArmed || picture.armed);
}

function show() {
  if (!samples.length) return;
  const picture = samples[samples.length - 1], t = TEXTS[language];
  const log = robot.log();
  if (log) { $("log").textContent = ($("log").textContent + log).slice(-8000); $("log").scrollTop = 1e9; }
  $("frames").textContent = robot.frames();
  $("hash").textContent = robot.hash();
  const state = picture.armed ? "armed" : wasArmed ? "relaxed" : "waiting";
  $("status").className = picture.armed ? "armed" : wasArmed ? "fault" : "";
  $("status").textContent = `${t[state]}, ${t.bus(Math.round(100 * picture.load))}, ${picture.time.toFixed(2)} s`;
  drawWorld($("world"), setup.layout, picture, trail);
  drawChart($("speeds"), samples, t.speed, [{ name: "target", dashed: true }, { name: "measured" }]);
  drawChart($("currents"), samples, t.current, [{ name: "current" }]);
}

// How fast this machine is: the best fifth of a second of a robot that nobody drives, in a copy of its own.
async function pace() {
  const other = await newRobot();
  let least = Infinity;
  for (let i = 0; i < 5; i++) {
    const start = performance.now();
    other.advance(200);
    least = Math.min(least, performance.now() - start);
  }
  const times = Math.round(200 / least);
  document.body.dataset.pace = times;
  $("pace").textContent = TEXTS[language].pace(times);
}

function slider(parent, name, values, object, [least, most, by], change) {
  const label = document.createElement("label"), text = document.createElement("span"), input = document.createElement("input"), output = document.createElement("output");
  Object.assign(input, { type: "range", min: least, max: most, step: by, value: object[name], id: `knob-${name}` });
  text.dataset.text = values;
  output.textContent = object[name];
  input.addEventListener("input", () => { object[name] = Number(input.value); output.textContent = input.value; change(); });
  label.append(text, input, output);
  parent.append(label);
}

// A choice starts a new robot.
function choice(parent, name, values) {
  const label = document.createElement("label"), text = document.createElement("span"), select = document.createElement("select");
  text.dataset.text = name; select.id = name;
  for (const value of values) select.append(Object.assign(document.createElement("option"), { value }));
  select.addEventListener("change", () => { setup[name] = select.value; restart(); });
  label.append(text, select);
  parent.append(label);
}

function translate() {
  document.documentElement.lang = language;
  for (const element of document.querySelectorAll("[data-text]")) element.textContent = TEXTS[language][element.dataset.text];
  for (const element of document.querySelectorAll("[data-trouble]")) element.textContent = TEXTS[language].trouble[element.dataset.trouble];
  for (const option of document.querySelectorAll("option")) option.textContent = TEXTS[language].choices[option.value];
  $("language").textContent = TEXTS[language].language;
  $("switch").textContent = TEXTS[language][$("switch").getAttribute("aria-pressed") === "true" ? "switch_on" : "switch_off"];
  if (document.body.dataset.pace) $("pace").textContent = TEXTS[language].pace(document.body.dataset.pace);
}

function build() {
  for (const name of TROUBLES) {
    const button = document.createElement("button");
    Object.assign(button, { type: "button" });
    button.dataset.trouble = name;
    button.addEventListener("click", () => {
      const begins = button.getAttribute("aria-pressed") !== "true";
      button.setAttribute("aria-pressed", begins);
      robot?.trouble(TROUBLES.indexOf(name), begins ? 1 : 0);
    });
    $("troubles").append(button);
  }
  const knobs = $("knobs");
  slider(knobs, "speed", "speed_knob", live, [0.1, 2, 0.1], steer);
  slider(knobs, "kp", "kp", live, [0.2, 8, 0.1], () => robot?.set("kp", live.kp));
  slider(knobs, "ki", "ki", live, [0, 60, 1], () => robot?.set("ki", live.ki));
  slider(knobs, "delay", "delay", live, [0, 12, 1], () => robot?.set("delay", live.delay));
  slider(knobs, "loss", "loss", live, [0, 60, 1], () => robot?.set("loss", live.loss / 100));
  choice($("troubles"), "watchdogs", WATCHDOGS);
  choice($("setup"), "layout", LAYOUTS);
  slider($("setup"), "mass", "mass", setup, [5, 40, 1], restart);
  slider($("setup"), "seed", "seed", setup, [1, 100, 1], restart);
  $("switch").addEventListener("click", () => setSwitch($("switch").getAttribute("aria-pressed") !== "true"));
  $("language").addEventListener("click", () => { language = language === "en" ? "zh" : "en"; translate(); });
  for (const button of document.querySelectorAll("[data-drive]")) {
    const [axis, sign] = button.dataset.drive.split(":");
    button.addEventListener("pointerdown", () => hold(button, [axis, Number(sign)]));
    for (const end of ["pointerup", "pointerleave", "pointercancel"]) button.addEventListener(end, () => hold(button));
  }
  const keys = { KeyW: ["ahead", 1], KeyS: ["ahead", -1], KeyA: ["left", 1], KeyD: ["left", -1], KeyQ: ["turn", 1], KeyE: ["turn", -1], ArrowUp: ["ahead", 1], ArrowDown: ["ahead", -1], ArrowLeft: ["left", 1], ArrowRight: ["left", -1] };
  addEventListener("keydown", (event) => { if (keys[event.code] && event.target.type !== "range") { event.preventDefault(); if (!event.repeat) hold(event.code, keys[event.code]); } });
  addEventListener("keyup", (event) => keys[event.code] && hold(event.code));
  addEventListener("blur", () => { held.clear(); steer(); });
  $("tour").addEventListener("click", async () => {
    const other = await newRobot();
    other.run_tour();
    $("result").hidden = false;
    $("result").textContent = TEXTS[language].tour_result(other.hash());
  });
  $("script").addEventListener("click", () => { $("result").hidden = false; $("result").textContent = robot ? TEXTS[language].script_result(robot.script()) : ""; });
  $("code").textContent = ROBOT;
}

build();
translate();
restart().then(pace).then(() => requestAnimationFrame(frame));
