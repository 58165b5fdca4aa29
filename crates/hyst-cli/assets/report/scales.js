// Scales of the axes: positions, ranges, ticks and number formats, linear and logarithmic. Pure functions.
const Scales = (() => {
  "use strict";

  // Smallest range that a zoom reaches, as a share of the whole range. Positions of points outside of the plot then
  // stay below 10^7 pixels, which a canvas draws without rounding errors.
  const MIN_SHARE = 1e-4;
  // Steps between the ticks of an axis in degrees.
  const DEGREES = [5, 15, 30, 45, 90, 180, 360];
  // Height of a decade of a logarithmic axis [pixels] from which on all its eight minor ticks are drawn, and 2 and 5.
  const DECADE_FOR_ALL = 80, DECADE_FOR_TWO = 30;

  // Formats a number with n digits as the rest of the page, independent of the language of the browser.
  const digits = (x, n) => {
    if (x === 0) return "0";
    const size = Math.abs(x);
    return size < 1e-4 || size >= 1e6 ? x.toExponential(n - 1).replace(/\.?0+e/, "e") : String(+x.toPrecision(n));
  };

  // Returns a scale. `share` maps a value to its share of the axis from 0 to 1; `value` maps a share to its value.
  const scale = ([min, max], log) => {
    const [to, back] = log ? [Math.log10, (p) => 10 ** p] : [Number, Number];
    const low = to(min), range = to(max) - low;
    return { min, max, log, share: (v) => (to(v) - low) / range, value: (s) => back(low + s * range) };
  };

  // Returns the range with a margin at both ends, or a range around a single value. A margin never reaches beyond zero.
  const padded = ([min, max], log, margin) => {
    if (!(min <= max)) return log ? [0.1, 1] : [0, 1];
    if (min === max) {
      if (log) return [min / 2, max * 2];
      const half = Math.abs(min) / 10 || 1;
      return [min - half, max + half];
    }
    const whole = scale([min, max], log);
    const [low, high] = [whole.value(-margin), whole.value(1 + margin)];
    return [min >= 0 && low < 0 ? 0 : low, max <= 0 && high > 0 ? 0 : high];
  };

  // Moves the value at share `from` to share `to` and scales the range by `factor`, within `whole`. Returns null for
  // the whole range.
  const moved = (range, whole, log, from, to, factor) => {
    const all = scale(whole, log);
    const [a, b] = range.map(all.share);
    const size = Math.max(MIN_SHARE, (b - a) * factor);
    if (size >= 1 - 1e-9) return null;
    const low = Math.min(Math.max(a + from * (b - a) - to * size, 0), 1 - size);
    return [all.value(low), all.value(low + size)];
  };

  // Returns the smallest of 1, 2 and 5 times a power of ten that is not below `least`.
  const roundStep = (least) => {
    const unit = 10 ** Math.floor(Math.log10(least));
    return unit * [1, 2, 5, 10].find((m) => m * unit >= least * (1 - 1e-9));
  };

  const multiples = (min, max, step) => {
    const first = Math.ceil(min / step - 1e-6), last = Math.floor(max / step + 1e-6);
    return Array.from({ length: Math.max(0, last - first + 1) }, (_, k) => (first + k) * step);
  };

  // Formats multiples of `step` with the same number of decimals.
  const labels = (values, step) => {
    const place = (x) => Math.floor(Math.log10(Math.abs(x)) + 1e-9);
    const most = Math.max(...values.map(Math.abs));
    return values.map((v) => {
      if (v === 0) return "0";
      if (most >= 1e6 || most < 1e-4) return v.toExponential(Math.max(0, place(v) - place(step)));
      return v.toFixed(Math.max(0, -place(step)));
    });
  };

  // Proposals for the ticks, the densest first; the last has at most one tick.
  function* linear(s, least, degrees) {
    const next = (size) => (degrees && size > 2 && DEGREES.find((d) => d >= size)) || roundStep(size);
    for (let step = next(least); ; step = next(1.5 * step)) {
      const values = multiples(s.min, s.max, step);
      yield { values, labels: labels(values, step) };
    }
  }

  function* logarithmic(s) {
    const powers = (step) => multiples(Math.log10(s.min), Math.log10(s.max), step).map((p) => 10 ** Math.round(p));
    const all = steps(s, [1, 2, 5]);
    if (all.length < 3) return yield* linear(s, (s.max - s.min) / 20);
    for (const values of [all, powers(1)]) yield { values, labels: values.map((v) => digits(v, 3)) };
    for (let step = 2; ; step++) yield { values: powers(step), labels: powers(step).map((v) => digits(v, 3)) };
  }

  // Returns the multiples of powers of ten within a scale.
  const steps = (s, factors) => {
    const values = [];
    for (let p = Math.floor(Math.log10(s.min)); 10 ** p <= s.max; p++) {
      values.push(...factors.map((m) => +(m * 10 ** p).toPrecision(12)));
    }
    return values.filter((v) => v >= s.min * (1 - 1e-9) && v <= s.max * (1 + 1e-9));
  };

  // Minor ticks of a logarithmic scale between the labelled ones.
  const minor = (s, length, values) => {
    const decade = length / Math.log10(s.max / s.min);
    const factors = decade >= DECADE_FOR_ALL ? [1, 2, 3, 4, 5, 6, 7, 8, 9] : decade >= DECADE_FOR_TWO ? [1, 2, 5] : [1];
    const isLabelled = (v) => values.some((major) => Math.abs(v - major) < 1e-6 * v);
    return steps(s, factors).filter((v) => !isLabelled(v));
  };

  // Returns the ticks of an axis of `length` pixels: `major` with labels, and `minor`. Linear axes have ticks about every
  // `spacing` pixels or more. `room` returns the pixels that a label needs.
  const ticks = (s, { length, spacing, room, degrees }) => {
    const least = ((s.max - s.min) * spacing) / length;
    for (const { values, labels } of s.log ? logarithmic(s) : linear(s, least, degrees)) {
      const at = values.map((v) => s.share(v) * length), rooms = labels.map(room);
      if (at.some((p, k) => k > 0 && p - at[k - 1] < (rooms[k] + rooms[k - 1]) / 2)) continue;
      return { major: values.map((value, k) => ({ value, label: labels[k] })), minor: s.log ? minor(s, length, values) : [] };
    }
  };

  return { digits, scale, padded, moved, ticks };
})();
