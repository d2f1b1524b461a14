// What one takes away: the picture, the data, the lines of Python.

function download(name, blob) {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
}

// All pictures of the page on one.
function picture(canvases, caption) {
  const ratio = window.devicePixelRatio || 1;
  const shown = canvases.filter((one) => one.offsetParent !== null);
  const width = Math.max(...shown.map((one) => one.width));
  const gap = 8 * ratio;
  const columns = shown.length > 2 ? 2 : 1;
  const heights = Array(columns).fill(32 * ratio);
  const places = shown.map((one) => {
    const column = heights.indexOf(Math.min(...heights));
    const place = [column * (width + gap), heights[column]];
    heights[column] += one.height + gap;
    return place;
  });
  const whole = document.createElement("canvas");
  whole.width = columns * width + (columns - 1) * gap;
  whole.height = Math.max(...heights);
  const c = whole.getContext("2d");
  c.fillStyle = paint("card");
  c.fillRect(0, 0, whole.width, whole.height);
  c.fillStyle = paint("ink");
  c.font = `${13 * ratio}px system-ui, 'DejaVu Sans', sans-serif`;
  c.fillText(caption, 8 * ratio, 20 * ratio, whole.width - 16 * ratio);
  shown.forEach((one, i) => c.drawImage(one, ...places[i]));
  return new Promise((done) => whole.toBlob(done, "image/png"));
}

const toText = (value) =>
  JSON.stringify(value, (key, one) => (typeof one === "number" && !Number.isFinite(one) ? String(one) : one), 1);
