// A clock that plays, pauses and is set by hand; the page says how long it runs (`playLength`) and what is seen at a time
// (`showTime`).

const PLAYED = 12000; // ms for all of it
const clock = { t: 0, running: false, last: 0 };

function setPlay(running) {
  clock.running = running;
  $("play").setAttribute("aria-pressed", String(running));
  $("play").textContent = running ? "Pause" : "Play";
}

function play() {
  if (clock.running) {
    setPlay(false);
    return;
  }
  if (!(playLength() > 0)) return;
  if (clock.t >= playLength()) clock.t = 0;
  setPlay(true);
  clock.last = performance.now();
  requestAnimationFrame(tick);
}

function tick(now) {
  if (!clock.running) return;
  clock.t = Math.min(playLength(), clock.t + (playLength() * Math.max(0, now - clock.last)) / PLAYED);
  clock.last = now;
  if (!(clock.t < playLength())) setPlay(false);
  showTime();
  if (clock.running) requestAnimationFrame(tick);
}

function setClock(t) {
  clock.t = Math.min(Math.max(0, t), playLength());
  showTime();
}

function rewind() {
  setPlay(false);
  clock.t = 0;
}

function wirePlay(series) {
  $("play").addEventListener("click", play);
  onPlot(series, (at) => setClock(at.x));
  onKeys(series, (key, step) => {
    if (key === "Enter" || key === " ") play();
    else if (step && !step[1]) setClock(clock.t + step[0]);
    else return false;
    return true;
  });
}

// The row that holds at a time, of rows that begin with their times; null after the last one.
function rowAt(rows, t, jumps = false) {
  let [a, b] = [0, rows.length - 1];
  if (b < 0 || t > rows[b][0]) return null;
  while (b - a > 1) {
    const m = (a + b) >> 1;
    if (rows[m][0] <= t) a = m;
    else b = m;
  }
  const share = jumps ? Number(t >= rows[b][0]) : (t - rows[a][0]) / (rows[b][0] - rows[a][0] || 1);
  return rows[a].map((one, k) => one + share * (rows[b][k] - one));
}

// Dots above a plot: places, each with a color.
function drawOver(plot, dots) {
  const dot = $("dot");
  [dot.width, dot.height] = [plot.canvas.width, plot.canvas.height];
  const c = dot.getContext("2d");
  const ratio = window.devicePixelRatio || 1;
  c.setTransform(ratio, 0, 0, ratio, 0, 0);
  for (const { x, y, color } of dots) {
    if (!(x >= plot.x[0] && x <= plot.x[1] && y >= plot.y[0] && y <= plot.y[1])) continue;
    c.fillStyle = paint(color);
    c.strokeStyle = paint("card");
    c.lineWidth = 2;
    c.beginPath();
    c.arc(plot.px(x), plot.py(y), 6, 0, TWO_PI);
    c.fill();
    c.stroke();
  }
}
