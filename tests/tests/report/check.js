// Checks every plot of a report in a browser: draws, zooms, resets, reads, hides a curve, prints. Sends what it saw to
// the frame's parent as JSON. Runs after the scripts of the page.
"use strict";

const frames = async (count) => {
  for (let k = 0; k < count; k++) await new Promise((then) => requestAnimationFrame(then));
};
const near = (a, b, tolerance) => a.every((v, k) => Math.abs(v - b[k]) <= tolerance);

// One plot and its elements.
const plotOf = (figure) => {
  const find = (name) => figure.querySelector(name);
  const drawing = find(".drawing"), cursor = find(".cursor"), plot = find(".plot"), readout = find(".readout");
  const picture = JSON.parse(document.getElementById("pictures").textContent)[+figure.dataset.picture];
  const event = (kind, x, y, more) => cursor.dispatchEvent(new PointerEvent(kind, {
    clientX: cursor.getBoundingClientRect().left + x, clientY: cursor.getBoundingClientRect().top + y,
    bubbles: true, cancelable: true, button: 0, pointerType: "mouse", ...more,
  }));
  // Position on the x axis that the readout states for the cursor at x, or NaN.
  const read = (x) => {
    event("pointermove", x, 100);
    const value = parseFloat(readout.textContent);
    return picture.x.log ? Math.log10(value) : value;
  };
  // Positions of the left and the right edge of the plot: pixels, and values on the x axis.
  const edges = () => {
    let left = 0, right = cursor.clientWidth - 1;
    while (left < right && Number.isNaN(read(left))) left++;
    while (left < right && Number.isNaN(read(right))) right--;
    return { left, right, range: [read(left), read(right)] };
  };
  const finger = (kind, pointerId, x) => event(kind, x, 100, { pointerId, pointerType: "touch" });
  return { find, drawing, cursor, plot, readout, picture, event, read, edges, finger };
};

// Whether a plot has pixels with the colour of one of its curves in the present colour scheme.
const hasColour = ({ drawing, picture }) => {
  const style = getComputedStyle(document.documentElement);
  const colours = new Set(picture.curves.map((curve) => parseInt(style.getPropertyValue("--" + curve.role).trim().slice(1), 16)));
  // A copy, because a browser warns of a canvas that is read often.
  const copy = document.createElement("canvas");
  [copy.width, copy.height] = [drawing.width, drawing.height];
  const context = copy.getContext("2d", { willReadFrequently: true });
  context.drawImage(drawing, 0, 0);
  const pixels = context.getImageData(0, 0, copy.width, copy.height).data;
  for (let i = 0; i < pixels.length; i += 4) {
    if (pixels[i + 3] === 255 && colours.has((pixels[i] << 16) | (pixels[i + 1] << 8) | pixels[i + 2])) return true;
  }
  return false;
};

const checkZoom = async (p, seen) => {
  const isZoomed = () => p.plot.classList.contains("zoomed");
  const { left, right, range: whole } = p.edges();
  const at = (share) => left + share * (right - left), length = whole[1] - whole[0], tolerance = 0.02 * length;
  const isWhole = async () => {
    await frames(2);
    return !isZoomed() && near(p.edges().range, whole, tolerance);
  };
  // Mouse: the dragged range fills the plot.
  const dragged = [p.read(at(0.3)), p.read(at(0.6))];
  p.event("pointerdown", at(0.3), 60);
  p.event("pointermove", at(0.5), 90);
  p.event("pointermove", at(0.6), 150);
  p.event("pointerup", at(0.6), 150);
  await frames(2);
  if (isZoomed() && near(p.edges().range, dragged, tolerance)) seen.zoomed += 1;
  p.cursor.dispatchEvent(new MouseEvent("dblclick", { bubbles: true }));
  if (await isWhole()) seen.whole += 1;
  // A click is no selection.
  p.event("pointerdown", at(0.5), 90);
  p.event("pointerup", at(0.5), 90);
  if (await isWhole()) seen.clicked += 1;

  // Two fingers: their distance triples, so that a third of the range remains.
  p.finger("pointerdown", 1, at(0.4));
  p.finger("pointerdown", 2, at(0.6));
  p.finger("pointermove", 1, at(0.2));
  p.finger("pointermove", 2, at(0.8));
  p.finger("pointerup", 1, at(0.2));
  p.finger("pointerup", 2, at(0.8));
  await frames(2);
  const pinched = p.edges().range;
  if (isZoomed() && near([pinched[1] - pinched[0], pinched[0] + pinched[1]], [length / 3, whole[0] + whole[1]], 2 * tolerance)) seen.pinched += 1;
  // One finger moves the plot by a tenth of what is visible.
  p.finger("pointerdown", 1, at(0.4));
  p.finger("pointermove", 1, at(0.5));
  p.finger("pointerup", 1, at(0.5));
  await frames(2);
  const moved = p.edges().range, tenth = (pinched[1] - pinched[0]) / 10;
  if (near(moved, pinched.map((v) => v - tenth), tenth / 3)) seen.moved += 1;
  p.find(".reset").click();
  if (await isWhole()) seen.reset += 1;

  const key = (name) => p.cursor.dispatchEvent(new KeyboardEvent("keydown", { key: name, bubbles: true, cancelable: true }));
  key("+");
  await frames(2);
  const half = p.edges().range;
  const isHalf = isZoomed() && near([half[1] - half[0]], [length / 2], tolerance);
  key("Escape");
  if (isHalf && await isWhole()) seen.keys += 1;
};

// Hides and shows a curve; both change the picture.
const checkKey = async (p, seen) => {
  const button = p.find(".key button"), before = p.drawing.toDataURL();
  button.click();
  await frames(2);
  const isHidden = button.getAttribute("aria-pressed") === "false" && p.drawing.toDataURL() !== before;
  button.click();
  await frames(2);
  if (isHidden && button.getAttribute("aria-pressed") === "true" && p.drawing.toDataURL() === before) seen.hidden += 1;
};

// Values at the cursor disappear with it.
const checkReadout = (p, seen) => {
  const { left, right } = p.edges();
  p.event("pointermove", (left + right) / 2, 100);
  const text = p.readout.textContent, values = text.split(": ")[1] ?? "";
  p.event("pointerleave", 0, 0);
  if (/\d/.test(values) && text.endsWith(p.picture.y.unit) && p.readout.textContent === "") seen.read += 1;
};

// Paper: white, with colours for white, whole ranges, and plots of the width of a column.
const checkPaper = async (plots, seen) => {
  const widest = () => Math.max(...plots.map((p) => p.drawing.getBoundingClientRect().width));
  const images = () => plots.map((p) => p.drawing.toDataURL());
  const print = (when) => dispatchEvent(new Event(when));
  const screen = widest(), shown = images();
  print("beforeprint");
  const whole = images();
  seen.paper = [widest(), getComputedStyle(document.body).backgroundColor, plots.filter(hasColour).length];
  print("afterprint");
  seen.back = widest() === screen && images().every((image, k) => image === shown[k]);
  for (const p of plots) p.cursor.dispatchEvent(new KeyboardEvent("keydown", { key: "+", bubbles: true }));
  await frames(2);
  const zoomed = images();
  print("beforeprint");
  seen.printed = images().filter((image, k) => image === whole[k] && zoomed[k] !== shown[k]).length;
  print("afterprint");
  seen.kept = plots.filter((p, k) => p.plot.classList.contains("zoomed") && p.drawing.toDataURL() === zoomed[k]).length;
};

// Ticks at 1, 2 and 5, whose labels state their values and do not overlap. Returns the axes where this is not so.
const wrongTicks = () => {
  const linear = [[0, 1], [0, 7.3], [-0.0042, 0.0091], [1e6, 3.7e6], [-2e-7, 5e-6], [12.3456, 12.3466]];
  const logarithmic = [[1, 1000], [0.03, 4], [1e-6, 1e3], [2e-5, 7e-3]];
  const cases = [...linear.map((range) => [range, false]), ...logarithmic.map((range) => [range, true])];
  const isRound = (v) => [1, 2, 5, 10].some((m) => Math.abs(v / 10 ** Math.floor(Math.log10(v) + 1e-9) - m) < 1e-6);
  return cases.flatMap(([range, log]) => [160, 520].flatMap((length) => {
    const scale = Scales.scale(range, log), room = (label) => 7 * label.length + 10;
    const { major, minor } = Scales.ticks(scale, { length, spacing: Math.min(60, length / 7), room });
    const size = range[1] - range[0], step = major.length > 1 ? major[1].value - major[0].value : NaN;
    const isRight = major.length > 1 && major.every(({ value, label }, k) => {
      const space = k ? (scale.share(value) - scale.share(major[k - 1].value)) * length : Infinity;
      const isAtStep = log ? isRound(value) : isRound(step) && Math.abs(value / step - Math.round(value / step)) < 1e-3;
      const tolerance = log ? 1e-9 * value : 1e-6 * size;
      return isAtStep && Math.abs(Number(label) - value) <= tolerance && space >= room(label) - 1e-6 &&
        value >= range[0] - tolerance && value <= range[1] + tolerance;
    });
    return isRight && (log || minor.length === 0) ? [] : [`${range} ${log} ${length}: ${major.map((t) => t.label)}`];
  }));
};

// A line of 100,000 points in 500 columns keeps its extremes and its gap.
const isThinned = () => {
  const n = 100_000, y = Float64Array.from({ length: n }, (_, k) => Math.sin(k / 100));
  [y[54_321], y[777], y[70_000]] = [9, -7, NaN];
  const kept = Curves.thinned(0, n, (k) => (k * 500) / n, (k) => y[k]);
  return kept.length <= 4 * 502 && [54_321, 777, 0, n - 1, -1].every((k) => kept.includes(k));
};

addEventListener("load", () => setTimeout(async () => {
  const counted = ["drawn", "zoomed", "whole", "clicked", "pinched", "moved", "reset", "keys", "hidden", "read", "resized"];
  const seen = { problems, cut: [], ...Object.fromEntries(counted.map((name) => [name, 0])) };
  const plots = [...document.querySelectorAll("figure")].map(plotOf);
  for (const p of plots) {
    const right = p.plot.getBoundingClientRect().right;
    if (p.drawing.getBoundingClientRect().right > right + 1 || right > innerWidth) seen.cut.push(p.picture.title);
    if (hasColour(p)) seen.drawn += 1;
    await checkZoom(p, seen);
    await checkKey(p, seen);
    checkReadout(p, seen);
  }
  seen.width = innerWidth;
  seen.across = document.documentElement.scrollWidth;
  seen.columns = new Set(plots.map((p) => Math.round(p.plot.getBoundingClientRect().left))).size;
  seen.background = getComputedStyle(document.body).backgroundColor;
  // Device pixels per pixel.
  seen.ratios = [...new Set(plots.map((p) => p.drawing.width / p.drawing.clientWidth))];
  seen.ticks = wrongTicks();
  seen.thinned = isThinned();
  await checkPaper(plots, seen);
  // A narrower page.
  document.body.style.width = "350px";
  dispatchEvent(new Event("resize"));
  seen.resized = plots.filter((p) => p.drawing.clientWidth === Math.floor(p.plot.clientWidth)).length;
  parent.postMessage(JSON.stringify(seen), "*");
}, 300));
