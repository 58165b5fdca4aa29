// Curves as numbers: what is visible of a curve, the points that a line needs, the value at the cursor. Pure functions.
const Curves = (() => {
  "use strict";

  // Converts a curve of the page: a missing value is NaN. A curve is a function if x never decreases; a loop is not.
  const read = (curve) => {
    const [x, y] = [curve.x, curve.y].map((values) => Float64Array.from(values, (v) => v ?? NaN));
    return { ...curve, x, y, isFunction: x.every((v, k) => v >= (k ? x[k - 1] : v)) };
  };

  // Returns the first index of ordered values that passes the test, or their number.
  const first = (values, test) => {
    let low = 0, high = values.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (test(values[middle])) high = middle; else low = middle + 1;
    }
    return low;
  };

  // Minimum and maximum of the finite values, on a logarithmic axis of the positive ones.
  const extent = (values, log, from = 0, to = values.length) => {
    let min = Infinity, max = -Infinity;
    for (let k = from; k < to; k++) {
      const v = values[k];
      if (!Number.isFinite(v) || (log && v <= 0)) continue;
      if (v < min) min = v;
      if (v > max) max = v;
    }
    return [min, max];
  };

  const union = (ranges) => [Math.min(...ranges.map((r) => r[0])), Math.max(...ranges.map((r) => r[1]))];

  // Value of the drawn line at x, between its points k - 1 and k; NaN beyond its ends and in its gaps.
  const between = (curve, k, x, scaleX, logY) => {
    if (k < 1 || k >= curve.x.length) return NaN;
    const [there, back] = logY ? [Math.log, Math.exp] : [Number, Number];
    const [a, b] = [scaleX.share(curve.x[k - 1]), scaleX.share(curve.x[k])];
    const [low, high] = [there(curve.y[k - 1]), there(curve.y[k])];
    return b > a ? back(low + ((high - low) * (scaleX.share(x) - a)) / (b - a)) : curve.y[k];
  };

  // Minimum and maximum of y of what is drawn within the scale of x; of a loop, of all its points.
  const visible = (curve, scaleX, logY) => {
    if (!curve.isFunction) return extent(curve.y, logY);
    const { min, max } = scaleX;
    const from = first(curve.x, (v) => v >= min), to = first(curve.x, (v) => v > max);
    const inside = extent(curve.y, logY, from, to);
    if (curve.style === "points") return inside;
    const ends = [between(curve, from, min, scaleX, logY), between(curve, to, max, scaleX, logY)];
    return union([inside, extent(ends, logY)]);
  };

  // Returns the indices of the points that a line needs: of the points that follow each other in one pixel column, the
  // first, the minimum, the maximum and the last. Every extreme is drawn. -1 interrupts the line.
  const thinned = (from, to, toX, toY) => {
    const kept = [];
    let start = -1, last, low, high, lowest, highest, column;
    const close = () => {
      if (start < 0) return;
      const [a, b] = low < high ? [low, high] : [high, low];
      kept.push(start);
      if (a > start) kept.push(a);
      if (b > a) kept.push(b);
      if (last > b) kept.push(last);
      start = -1;
    };
    for (let k = from; k < to; k++) {
      const x = toX(k), y = toY(k);
      if (!Number.isFinite(x) || !Number.isFinite(y)) {
        close();
        kept.push(-1);
        continue;
      }
      if (start < 0 || Math.floor(x) !== column) {
        close();
        column = Math.floor(x);
        start = low = high = k;
        lowest = highest = y;
      } else if (y < lowest) {
        low = k;
        lowest = y;
      } else if (y > highest) {
        high = k;
        highest = y;
      }
      last = k;
    }
    close();
    return kept;
  };

  // Returns the point where the line from a to b crosses x.
  const crossing = ([ax, ay], [bx, by], x) => [x, ay + ((by - ay) * (x - ax)) / (bx - ax)];

  // Returns the parts of a line, each a list of points [x, y] in device pixels. A function is cut at the edges of the
  // plot, so that no point is far outside.
  const line = (curve, scaleX, toX, toY) => {
    let from = 0, to = curve.x.length;
    if (curve.isFunction) {
      from = Math.max(0, first(curve.x, (v) => v >= scaleX.min) - 1);
      to = Math.min(to, first(curve.x, (v) => v > scaleX.max) + 1);
    }
    const x = (k) => toX(curve.x[k]), y = (k) => toY(curve.y[k]);
    const parts = [];
    let part = null;
    for (const k of thinned(from, to, x, y)) {
      if (k < 0) part = null;
      else if (part) part.push([x(k), y(k)]);
      else parts.push((part = [[x(k), y(k)]]));
    }
    if (!curve.isFunction) return parts;
    const left = toX(scaleX.min), right = toX(scaleX.max);
    for (const p of parts) {
      if (p.length > 1 && p[0][0] < left) p[0] = crossing(p[0], p[1], left);
      const n = p.length - 1;
      if (n > 0 && p[n][0] > right) p[n] = crossing(p[n - 1], p[n], right);
    }
    return parts;
  };

  // Returns the points [x, y] in pixels of a curve of single points: inside the plot, one per pixel.
  const points = (curve, toX, toY, isInside) => {
    const kept = new Map();
    for (let k = 0; k < curve.x.length; k++) {
      const x = toX(curve.x[k]), y = toY(curve.y[k]);
      if (isInside(x, y)) kept.set(Math.floor(x) * 65536 + Math.floor(y), [x, y]);
    }
    return [...kept.values()];
  };

  // Returns the point of a function to read at x, or null: the nearest point. Where no point of a line is within
  // `reach` (a share of the axis), it is the value of the line.
  const at = (curve, x, scaleX, logY, reach) => {
    const middle = first(curve.x, (v) => v >= x);
    const far = (k) => Math.abs(scaleX.share(curve.x[k]) - scaleX.share(x));
    const isShown = (k) => Number.isFinite(curve.y[k]) && !(logY && curve.y[k] <= 0);
    const limit = curve.style === "points" ? 1 : reach;
    let best = null;
    for (const step of [-1, 1]) {
      for (let k = step < 0 ? middle - 1 : middle; k >= 0 && k < curve.x.length && far(k) <= limit; k += step) {
        if (!isShown(k)) continue;
        if (best === null || far(k) < far(best)) best = k;
        break;
      }
    }
    if (best !== null) return { x: curve.x[best], y: curve.y[best] };
    const y = curve.style === "points" ? NaN : between(curve, middle, x, scaleX, logY);
    return Number.isFinite(y) ? { x, y } : null;
  };

  return { read, extent, union, visible, thinned, line, points, at };
})();
