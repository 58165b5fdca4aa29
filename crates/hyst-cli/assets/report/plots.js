// Draws the pictures of a report from the data in the page.
(() => {
  "use strict";
  const root = document.documentElement;
  const pictures = JSON.parse(document.getElementById("pictures").textContent);
  const colour = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();
  const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif";

  // Formats numbers as the rest of the page, independent of the language of the browser.
  const digits = (x, n) => {
    if (x === 0) return "0";
    const size = Math.abs(x);
    return size < 1e-4 || size >= 1e6 ? x.toExponential(n - 1).replace(/\.?0+e/, "e") : String(+x.toPrecision(n));
  };
  const spaced = (label, unit) => (unit ? `${label} [${unit}]` : label);
  const added = (parent, tag, className, text) => {
    const element = document.createElement(tag);
    element.className = className;
    element.textContent = text;
    parent.append(element);
    return element;
  };

  // Whether a curve is a function (x never decreases); a loop is not.
  const isFunction = (curve) => curve.x.every((x, k) => k === 0 || x >= curve.x[k - 1]);

  // Draws a curve that is not a function: its points are connected in their order.
  const path = (u, si) => {
    const [xs, ys] = u.data[si];
    const stroke = new Path2D();
    let down = false;
    for (let k = 0; k < xs.length; k++) {
      if (ys[k] == null) { down = false; continue; }
      const x = u.valToPos(xs[k], "x", true), y = u.valToPos(ys[k], "y", true);
      if (down) stroke.lineTo(x, y); else stroke.moveTo(x, y);
      down = true;
    }
    return { stroke, fill: null, clip: null, band: null, gaps: null, flags: 1 };
  };

  // Returns the index of the nearest value of a curve that has no value at idx.
  const nearest = (u, si, idx) => {
    const ys = u.data[si];
    for (let d = 0; d < 400; d++) {
      for (const k of [idx - d, idx + d]) if (ys[k] != null) return k;
    }
    return null;
  };

  // Width of an axis: that of its longest number.
  const room = (u, values, i, cycle) => {
    const axis = u.axes[i];
    if (cycle > 1) return axis._size;
    const longest = (values ?? []).reduce((a, v) => (v && v.length > a.length ? v : a), "");
    u.ctx.font = axis.font[0];
    return Math.ceil(axis.ticks.size + axis.gap + 4 + u.ctx.measureText(longest).width / uPlot.pxRatio);
  };

  const axis = (log, more) => ({
    font: FONT, stroke: () => colour("soft"), grid: { stroke: () => colour("grid"), width: 1 },
    ticks: { stroke: () => colour("edge"), size: 5 }, gap: 4,
    values: (u, splits) => splits.map((v) => (v == null ? "" : digits(v, 6))),
    // Labels of a logarithmic axis: powers of ten; an axis of few decades has more.
    filter: log ? (u, splits) => {
      const leading = splits.map((v) => v / 10 ** Math.floor(Math.log10(v) + 1e-9));
      const is = (m, k) => Math.abs(m - k) < 1e-6;
      const decades = leading.filter((m) => is(m, 1)).length;
      const kept = decades > 2 ? [1] : decades > 1 ? [1, 3] : [1, 2, 5];
      return splits.map((v, i) => (kept.some((k) => is(leading[i], k)) ? v : null));
    } : undefined,
    ...more,
  });

  // Draws a line at zero and the named marks.
  const lines = (picture) => (u) => {
    const { ctx, bbox } = u;
    const line = (x0, y0, x1, y1, stroke, dash) => {
      ctx.save();
      ctx.strokeStyle = stroke;
      ctx.lineWidth = uPlot.pxRatio;
      ctx.setLineDash(dash.map((d) => d * uPlot.pxRatio));
      ctx.beginPath(); ctx.moveTo(x0, y0); ctx.lineTo(x1, y1); ctx.stroke();
      ctx.restore();
    };
    const { min, max } = u.scales.y;
    if (!picture.y.log && min < 0 && max > 0) {
      const y = u.valToPos(0, "y", true);
      line(bbox.left, y, bbox.left + bbox.width, y, colour("soft"), []);
    }
    (picture.marks ?? []).forEach(({ at, name }, i) => {
      if (at < u.scales.x.min || at > u.scales.x.max) return;
      const x = u.valToPos(at, "x", true);
      line(x, bbox.top, x, bbox.top + bbox.height, colour("reference"), [5, 4]);
      ctx.save();
      ctx.font = FONT.replace("12px", `${12 * uPlot.pxRatio}px`);
      const pad = 4 * uPlot.pxRatio, height = 15 * uPlot.pxRatio, width = ctx.measureText(name).width;
      const left = x + 2 * pad + width > bbox.left + bbox.width ? x - pad - width : x + pad;
      const top = bbox.top + pad + i * height;
      ctx.fillStyle = colour("paper");
      ctx.globalAlpha = 0.85;
      ctx.fillRect(left - pad / 2, top - pad / 2, width + pad, height);
      ctx.globalAlpha = 1;
      ctx.fillStyle = colour("reference");
      ctx.textAlign = "left";
      ctx.textBaseline = "top";
      ctx.fillText(name, left, top);
      ctx.restore();
    });
  };

  // Shows the values at the cursor as text.
  const reading = (picture, functions) => (u) => {
    const { left, top, idxs } = u.cursor;
    if (left == null || left < 0) { u.readout.textContent = ""; return; }
    const x = `${digits(u.posToVal(left, "x"), 4)} ${picture.x.unit}`;
    const values = !functions ? [`${digits(u.posToVal(top, "y"), 4)} ${picture.y.unit}`] :
      picture.curves.flatMap((curve, i) => {
        const value = idxs?.[i + 1] == null ? null : u.data[i + 1][idxs[i + 1]];
        return value == null ? [] : [`${curve.name} ${digits(value, 4)} ${picture.y.unit}`];
      });
    u.readout.textContent = `${x}: ${values.join(", ")}`;
  };

  // Touch: two fingers zoom, one finger moves a zoomed plot, a vertical swipe scrolls the page. A double tap resets.
  const touch = (u, zoom) => {
    const fingers = new Map();
    let before = null;
    const place = (e) => {
      const box = u.over.getBoundingClientRect();
      return [(e.clientX - box.left) / box.width, 1 - (e.clientY - box.top) / box.height];
    };
    const state = () => {
      const points = [...fingers.values()];
      const middle = [0, 1].map((c) => points.reduce((sum, p) => sum + p[c], 0) / points.length);
      const reach = points.length > 1 ? Math.max(0.05, Math.hypot(points[0][0] - points[1][0], points[0][1] - points[1][1])) : null;
      return { middle, reach };
    };
    u.over.addEventListener("pointerdown", (e) => {
      if (e.pointerType !== "touch") return;
      fingers.set(e.pointerId, place(e));
      before = state();
    });
    u.over.addEventListener("pointermove", (e) => {
      if (!fingers.has(e.pointerId)) return;
      fingers.set(e.pointerId, place(e));
      const now = state();
      const factor = now.reach && before.reach ? before.reach / now.reach : 1;
      if (factor !== 1 || u.zoomed) zoom(before.middle, now.middle, factor);
      before = now;
    });
    for (const end of ["pointerup", "pointercancel", "pointerleave"]) {
      u.over.addEventListener(end, (e) => {
        fingers.delete(e.pointerId);
        if (fingers.size) before = state();
      });
    }
  };

  const height = (width) => Math.round(Math.max(210, Math.min(330, 0.6 * width)));

  const draw = (figure, picture) => {
    const place = figure.querySelector(".plot");
    const functions = picture.curves.every(isFunction);
    added(place, "p", "axis", spaced(picture.y.label, picture.y.unit));
    const frame = added(place, "div", "frame", "");
    added(place, "p", "axis across", spaced(picture.x.label, picture.x.unit));
    const reset = added(place, "button", "reset", "reset zoom");
    reset.type = "button";

    const series = picture.curves.map((curve) => {
      const stroke = () => colour(curve.role);
      const points = curve.style === "points";
      const common = { label: curve.name, stroke, width: points ? 0 : curve.role === "measured" ? 2.5 : 1.5 };
      if (!functions) return { ...common, facets: [{ scale: "x", auto: true }, { scale: "y", auto: true }], paths: path, points: { show: false } };
      const shown = { show: points, size: 6, width: 0, fill: stroke, stroke };
      return points ? { ...common, paths: () => null, points: shown } : { ...common, points: shown };
    });
    const scale = (log) => (log ? { time: false, distr: 3 } : { time: false });
    // A margin, so that points at the ends are drawn completely.
    const bound = (min, max) => (picture.x.log ? [min / (max / min) ** 0.015, max * (max / min) ** 0.015] : [min - 0.015 * (max - min), max + 0.015 * (max - min)]);
    const options = {
      width: frame.clientWidth, height: height(frame.clientWidth), mode: functions ? 1 : 2, legend: { show: false }, padding: [8, 22, 0, 0],
      scales: {
        x: { ...scale(picture.x.log), range: (u, min, max) => (min == null ? [0, 1] : bound(min, max)) },
        y: scale(picture.y.log),
      },
      axes: [axis(picture.x.log, { size: 30, space: 60, ...(picture.x.unit === "°" ? { incrs: [15, 30, 45, 90] } : {}) }), axis(picture.y.log, { size: room, space: 34 })],
      series: [{ label: picture.x.label }, ...series],
      cursor: { drag: { x: true, y: !functions, uni: 20 }, points: { show: functions, size: 7 }, dataIdx: functions ? nearest : undefined },
      hooks: {
        drawAxes: [lines(picture)],
        setCursor: [(u) => u.readout && reading(picture, functions)(u)],
        setSelect: [(u) => zoomed(u, u.select.width > 0)],
      },
    };
    if (!functions) options.cursor.dataIdx = () => null;
    const data = functions ? uPlot.join(picture.curves.map((c) => [c.x, c.y])) : [null, ...picture.curves.map((c) => [c.x, c.y])];
    const u = new uPlot(options, data, frame);
    u.readout = added(place, "output", "readout", "");
    const whole = { x: { ...u.scales.x }, y: { ...u.scales.y } };

    function zoomed(u, is) {
      u.zoomed = is;
      place.classList.toggle("zoomed", is);
    }
    const all = () => {
      zoomed(u, false);
      u.setData(data);
    };
    reset.addEventListener("click", all);
    u.over.addEventListener("dblclick", all);

    // Moves the point at `from` to `to` (shares of the plot) and scales the range by `factor`.
    const zoom = (from, to, factor) => {
      zoomed(u, true);
      (functions ? ["x"] : ["x", "y"]).forEach((key, c) => {
        const { min, max, distr } = u.scales[key];
        const [there, back] = distr === 3 ? [Math.log, Math.exp] : [(v) => v, (v) => v];
        const [a, b] = [there(min), there(max)];
        const held = a + from[c] * (b - a), range = (b - a) * factor;
        const low = Math.max(there(whole[key].min), held - to[c] * range);
        const high = Math.min(there(whole[key].max), low + range);
        if (high - low > 1e-6 * (there(whole[key].max) - there(whole[key].min))) u.setScale(key, { min: back(low), max: back(high) });
      });
    };
    touch(u, zoom);
    return { u, frame };
  };

  const plots = [...document.querySelectorAll("figure[data-picture]")].map((figure) => draw(figure, pictures[+figure.dataset.picture]));

  const fit = (plot, width) => {
    if (width > 0 && width !== plot.u.width) plot.u.setSize({ width, height: height(width) });
  };
  let paper = false;
  const fitAll = () => {
    if (!paper) plots.forEach((plot) => fit(plot, Math.floor(plot.frame.clientWidth)));
  };
  addEventListener("resize", fitAll);
  // Other changes of the width. In the next frame, because a plot that grows moves other plots.
  const widths = new ResizeObserver(() => requestAnimationFrame(fitAll));
  plots.forEach((plot) => widths.observe(plot.frame));

  // Width of a plot on paper: half of the printable width of the narrower of A4 and letter.
  const PAPER = 320;
  const onPaper = (is) => {
    if (is === paper) return;
    paper = is;
    root.classList.toggle("paper", is);
    plots.forEach((plot) => {
      fit(plot, is ? PAPER : Math.floor(plot.frame.clientWidth));
      plot.u.redraw();
    });
  };
  addEventListener("beforeprint", () => onPaper(true));
  addEventListener("afterprint", () => onPaper(false));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach((plot) => plot.u.redraw()));
})();
