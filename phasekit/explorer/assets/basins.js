// Basins: from the middle of each square of the portrait a motion is followed to where it ends; large squares come first.

const TINTS = ["accent", "second", "orbit", "degenerate", "separatrix", "muted"];
const TINT_WORDS = ["blue", "orange", "green", "purple", "red", "gray"];
const tint = (i) => i % TINTS.length;

class Basins {
  // `ends(x, y)` is the number of the attractor that the motion from there ends at, -1 where that is not known.
  constructor(ends, x, y, columns = 72, rows = 48) {
    Object.assign(this, { ends, x, y, columns, rows, done: false });
    this.found = new Int8Array(columns * rows).fill(-2);
  }

  // Yields after each motion; tells `seen` when a size of squares is done.
  *work(seen) {
    const { columns, rows, found, x, y } = this;
    for (const stride of [8, 4, 2, 1]) {
      this.stride = stride;
      for (let j = 0; j < rows; j += stride) {
        for (let i = 0; i < columns; i += stride) {
          if (found[j * columns + i] !== -2) continue;
          found[j * columns + i] = this.ends(x[0] + ((x[1] - x[0]) * (i + 0.5)) / columns, y[0] + ((y[1] - y[0]) * (j + 0.5)) / rows);
          yield;
        }
      }
      this.done = stride === 1;
      this.shown = stride;
      seen();
    }
  }

  // Ends that were found, in order; tints tell them apart only where there are two.
  get kinds() {
    return [...new Set(this.found)].filter((one) => one >= 0).sort((a, b) => a - b);
  }

  draw(plot) {
    if (!this.shown || this.kinds.length < 2) return;
    const { columns, rows, found, shown, x, y } = this;
    const place = ([low, high], share) => low + (high - low) * share;
    plot.c.globalAlpha = 0.2;
    for (let j = 0; j < rows; j += shown) {
      const [top, bottom] = [plot.py(place(y, (j + shown) / rows)), plot.py(place(y, j / rows))];
      for (let i = 0; i < columns;) {
        const kind = found[j * columns + i];
        let k = i;
        while (k < columns && found[j * columns + k] === kind) k += shown;
        if (kind >= 0) {
          plot.c.fillStyle = paint(TINTS[tint(kind)]);
          plot.c.fillRect(plot.px(place(x, i / columns)), top, plot.px(place(x, k / columns)) - plot.px(place(x, i / columns)), bottom - top);
        }
        i = k;
      }
    }
    plot.c.globalAlpha = 1;
  }

  words(names) {
    const { kinds } = this;
    if (!this.shown || kinds.length < 2) return "";
    const open = this.done && this.found.includes(-1) ? "; untinted: not known" : "";
    return `Tinted: where motions end: ${kinds.map((one) => `${TINT_WORDS[tint(one)]}: ${names[one]}`).join("; ")}${open}. `;
  }
}

function wireBasins() {
  $("basins").addEventListener("change", () => {
    state.basins = $("basins").checked;
    update(null);
  });
}

// Work in pieces of 8 ms, when nothing has moved for a while.
const IDLE = 160; // ms
const searches = { due: 0, running: 0, tasks: [] };

function cancel() {
  clearTimeout(searches.due);
  clearTimeout(searches.running);
  searches.tasks = [];
}

function begin(tasks) {
  cancel();
  searches.tasks = tasks;
  document.body.classList.toggle("searching", tasks.length > 0);
  if (tasks.length) searches.due = setTimeout(pump, IDLE);
}

function pump() {
  const end = performance.now() + 8;
  while (searches.tasks.length && performance.now() < end) if (searches.tasks[0].next().done) searches.tasks.shift();
  if (searches.tasks.length) searches.running = setTimeout(pump, 0);
  else document.body.classList.remove("searching");
}
