const COLORS = ["#1f77b4", "#d62728", "#2ca02c", "#9467bd"];
const WHEELS = {
  mecanum: [[0.2, 0.18, 0], [0.2, -0.18, 0], [-0.2, 0.18, 0], [-0.2, -0.18, 0]],
  omni: [60, -60, 180].map((d) => [0.22 * Math.cos(d * Math.PI / 180), 0.22 * Math.sin(d * Math.PI / 180), (d + 90) * Math.PI / 180]),
  differential: [[0, 0.18, 0], [0, -0.18, 0]],
};
const style = (name) => getComputedStyle(document.documentElement).getPropertyValue(name).trim();

// The floor in metres around the robot, seen from above: x to the right, y up.
function drawWorld(canvas, layout, picture, trail) {
  const g = canvas.getContext("2d"), scale = 130;
  g.setTransform(1, 0, 0, 1, 0, 0);
  g.clearRect(0, 0, canvas.width, canvas.height);
  g.setTransform(scale, 0, 0, -scale, canvas.width / 2 - picture.x * scale, canvas.height / 2 + picture.y * scale);
  const left = picture.x - canvas.width / 2 / scale, bottom = picture.y - canvas.height / 2 / scale;
  g.lineWidth = 0.004; g.strokeStyle = style("--line");
  g.beginPath();
  for (let x = Math.floor(left * 2) / 2; x < left + canvas.width / scale; x += 0.5) { g.moveTo(x, bottom); g.lineTo(x, bottom + canvas.height / scale); }
  for (let y = Math.floor(bottom * 2) / 2; y < bottom + canvas.height / scale; y += 0.5) { g.moveTo(left, y); g.lineTo(left + canvas.width / scale, y); }
  g.stroke();
  g.lineWidth = 0.015; g.strokeStyle = style("--accent"); g.beginPath();
  trail.forEach(([x, y], i) => (i ? g.lineTo(x, y) : g.moveTo(x, y)));
  g.stroke();
  g.translate(picture.x, picture.y); g.rotate(picture.heading);
  g.fillStyle = picture.armed ? style("--go") : style("--stop"); g.globalAlpha = 0.75;
  g.fillRect(-0.25, -0.16, 0.5, 0.32); g.globalAlpha = 1;
  g.fillStyle = style("--ink");
  g.beginPath(); g.moveTo(0.22, 0); g.lineTo(0.1, 0.07); g.lineTo(0.1, -0.07); g.fill();
  WHEELS[layout].forEach(([x, y, angle], i) => {
    g.save(); g.translate(x, y); g.rotate(angle);
    g.fillStyle = picture.wheels[i] && Number.isFinite(picture.wheels[i].measured) ? COLORS[i] : "#888";
    g.fillRect(-0.076, -0.025, 0.152, 0.05); g.restore();
  });
}

// The last five seconds of a signal of each wheel; NaN leaves a gap.
function drawChart(canvas, samples, unit, signals) {
  const g = canvas.getContext("2d"), { width, height } = canvas, span = 5;
  g.setTransform(1, 0, 0, 1, 0, 0);
  g.clearRect(0, 0, width, height);
  const now = samples.length ? samples[samples.length - 1].time : 0;
  let most = 1;
  for (const sample of samples) for (const wheel of sample.wheels) for (const { name } of signals) if (Number.isFinite(wheel[name])) most = Math.max(most, Math.abs(wheel[name]));
  const x = (time) => width - (now - time) / span * (width - 60), y = (value) => height / 2 - value / most * (height / 2 - 14);
  g.font = "12px system-ui, sans-serif"; g.fillStyle = style("--ink"); g.strokeStyle = style("--line"); g.lineWidth = 1;
  for (const value of [most, 0, -most]) {
    g.beginPath(); g.moveTo(60, y(value)); g.lineTo(width, y(value)); g.stroke();
    g.fillText(`${value.toFixed(1)} ${unit}`, 2, y(value) + 4);
  }
  const wheels = samples.length ? samples[samples.length - 1].wheels.length : 0;
  for (let i = 0; i < wheels; i++) for (const { name, dashed } of signals) {
    g.strokeStyle = COLORS[i]; g.setLineDash(dashed ? [4, 4] : []); g.lineWidth = dashed ? 1 : 1.6;
    g.beginPath();
    let pen = false;
    for (const sample of samples) {
      const value = sample.wheels[i] && sample.wheels[i][name];
      if (!Number.isFinite(value)) { pen = false; continue; }
      if (pen) g.lineTo(x(sample.time), y(value)); else g.moveTo(x(sample.time), y(value));
      pen = true;
    }
    g.stroke();
  }
  g.setLineDash([]);
}
