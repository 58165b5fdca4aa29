// Draws a plot on a canvas: axes, grid, marks, curves; and on a second canvas above it what follows the cursor.
const Drawing = (() => {
  "use strict";

  const FONT = "12px system-ui, -apple-system, 'Segoe UI', Roboto, Arial, sans-serif";
  // Sizes in CSS pixels: space around the plot, length of a tick, gap to its label, radius of a point.
  const TOP = 8, RIGHT = 22, BOTTOM = 30, TICK = 5, GAP = 4, RADIUS = 3;
  // Points of one path; browsers draw several short paths faster than a long one that crosses itself.
  const MOST_IN_PATH = 500;

  // Gives a canvas its size in CSS pixels and in device pixels. Returns its context, cleared, in CSS pixels.
  const prepare = (canvas, { width, height, ratio }) => {
    const [w, h] = [Math.round(width * ratio), Math.round(height * ratio)];
    if (canvas.width !== w || canvas.height !== h) [canvas.width, canvas.height] = [w, h];
    canvas.style.width = `${width}px`;
    canvas.style.height = `${height}px`;
    const ctx = canvas.getContext("2d");
    ctx.setTransform(ratio, 0, 0, ratio, 0, 0);
    ctx.clearRect(0, 0, width, height);
    ctx.font = FONT;
    return ctx;
  };

  // Draws a horizontal or vertical line of one CSS pixel, aligned to device pixels.
  const straight = (ctx, ratio, colour, [x0, y0], [x1, y1], dash = []) => {
    const thick = Math.max(1, Math.round(ratio));
    const aligned = (v) => (Math.round(v * ratio) + (thick % 2) / 2) / ratio;
    ctx.strokeStyle = colour;
    ctx.lineWidth = thick / ratio;
    ctx.setLineDash(dash);
    ctx.beginPath();
    ctx.moveTo(aligned(x0), aligned(y0));
    ctx.lineTo(aligned(x1), aligned(y1));
    ctx.stroke();
    ctx.setLineDash([]);
  };

  // Returns the place of the plot between its axes, and the ticks. The left axis is as wide as its longest label.
  const layout = (ctx, { width, height }, x, y, degrees) => {
    const wide = (label) => ctx.measureText(label).width;
    const area = { top: TOP, height: height - TOP - BOTTOM };
    // Short axes have denser ticks, so that they have enough of them.
    const spacing = (length, count, min, max) => Math.min(Math.max(length / count, min), max);
    const yTicks = Scales.ticks(y, { length: area.height, spacing: spacing(area.height, 8, 24, 34), room: () => 17 });
    area.left = Math.ceil(TICK + 2 * GAP + Math.max(0, ...yTicks.major.map((t) => wide(t.label))));
    area.width = Math.max(40, width - area.left - RIGHT);
    const room = (label) => wide(label) + 14;
    const xTicks = Scales.ticks(x, { length: area.width, spacing: spacing(area.width, 7, 36, 60), room, degrees });
    const toX = (v) => area.left + x.share(v) * area.width;
    const toY = (v) => area.top + (1 - y.share(v)) * area.height;
    return { area, xTicks, yTicks, toX, toY };
  };

  const axes = (ctx, ratio, { area, xTicks, yTicks, toX, toY }, colour) => {
    const right = area.left + area.width, bottom = area.top + area.height;
    const vertical = (v, stroke, from, to) => straight(ctx, ratio, stroke, [toX(v), from], [toX(v), to]);
    const horizontal = (v, stroke, from, to) => straight(ctx, ratio, stroke, [from, toY(v)], [to, toY(v)]);
    ctx.globalAlpha = 0.6;
    for (const v of xTicks.minor) vertical(v, colour("grid"), area.top, bottom);
    for (const v of yTicks.minor) horizontal(v, colour("grid"), area.left, right);
    ctx.globalAlpha = 1;
    ctx.fillStyle = colour("soft");
    ctx.textAlign = "center";
    ctx.textBaseline = "top";
    for (const v of xTicks.minor) vertical(v, colour("edge"), bottom, bottom + TICK / 2);
    for (const { value, label } of xTicks.major) {
      vertical(value, colour("grid"), area.top, bottom);
      vertical(value, colour("edge"), bottom, bottom + TICK);
      ctx.fillText(label, toX(value), bottom + TICK + GAP);
    }
    ctx.textAlign = "right";
    ctx.textBaseline = "middle";
    for (const v of yTicks.minor) horizontal(v, colour("edge"), area.left - TICK / 2, area.left);
    for (const { value, label } of yTicks.major) {
      horizontal(value, colour("grid"), area.left, right);
      horizontal(value, colour("edge"), area.left - TICK, area.left);
      ctx.fillText(label, area.left - TICK - GAP, toY(value));
    }
  };

  // Draws the named positions on the x axis.
  const marks = (ctx, ratio, list, x, { area, toX }, colour) => {
    const pad = 4, height = 15;
    list.filter(({ at }) => at >= x.min && at <= x.max).forEach(({ at, name }, i) => {
      const place = toX(at), width = ctx.measureText(name).width;
      straight(ctx, ratio, colour("reference"), [place, area.top], [place, area.top + area.height], [5, 4]);
      const isLeft = place + 2 * pad + width > area.left + area.width;
      const left = isLeft ? place - pad - width : place + pad, top = area.top + pad + i * height;
      ctx.fillStyle = colour("paper");
      ctx.globalAlpha = 0.85;
      ctx.fillRect(left - pad / 2, top - pad / 2, width + pad, height);
      ctx.globalAlpha = 1;
      ctx.fillStyle = colour("reference");
      ctx.textAlign = "left";
      ctx.textBaseline = "top";
      ctx.fillText(name, left, top);
    });
  };

  const dot = (ctx, x, y, radius) => {
    ctx.moveTo(x + radius, y);
    ctx.arc(x, y, radius, 0, 2 * Math.PI);
  };

  // Draws a curve of single points. A point at an edge of the plot is drawn completely.
  const points = (ctx, c, { area, toX, toY }, colour) => {
    const isWithin = (v, from, length) => v >= from - 0.5 && v <= from + length + 0.5;
    const isInside = (x, y) => isWithin(x, area.left, area.width) && isWithin(y, area.top, area.height);
    ctx.fillStyle = colour(c.role);
    ctx.beginPath();
    Curves.points(c, toX, toY, isInside).forEach(([x, y], k) => {
      dot(ctx, x, y, RADIUS);
      if ((k + 1) % MOST_IN_PATH > 0) return;
      ctx.fill();
      ctx.beginPath();
    });
    ctx.fill();
  };

  const line = (ctx, ratio, c, x, { area, toX, toY }, colour) => {
    ctx.save();
    ctx.beginPath();
    ctx.rect(area.left - 1, area.top - 1, area.width + 2, area.height + 2);
    ctx.clip();
    ctx.strokeStyle = colour(c.role);
    ctx.lineWidth = c.role === "measured" ? 2.5 : 1.5;
    ctx.lineJoin = "round";
    for (const part of Curves.line(c, x, (v) => toX(v) * ratio, (v) => toY(v) * ratio)) {
      // A single point between gaps is one pixel long.
      if (part.length === 1) part.push([part[0][0] + 1, part[0][1]]);
      ctx.beginPath();
      part.forEach(([px, py], k) => {
        ctx.lineTo(px / ratio, py / ratio);
        if (k === 0 || k % MOST_IN_PATH > 0) return;
        ctx.stroke();
        ctx.beginPath();
        ctx.moveTo(px / ratio, py / ratio);
      });
      ctx.stroke();
    }
    ctx.restore();
  };

  // Draws a plot. Returns the place between its axes and the pixels of values.
  const plot = (canvas, size, { x, y, curves, marked, degrees }, colour) => {
    const ctx = prepare(canvas, size), { ratio } = size;
    const places = layout(ctx, size, x, y, degrees), { area } = places;
    axes(ctx, ratio, places, colour);
    if (!y.log && y.min < 0 && y.max > 0) {
      straight(ctx, ratio, colour("soft"), [area.left, places.toY(0)], [area.left + area.width, places.toY(0)]);
    }
    marks(ctx, ratio, marked, x, places, colour);
    for (const c of curves) {
      if (c.style === "points") points(ctx, c, places, colour);
      else line(ctx, ratio, c, x, places, colour);
    }
    return places;
  };

  // Draws the lines of the cursor, the points that are read, and the selected rectangle.
  const cursor = (canvas, size, area, { at, dots, selected }, colour) => {
    const ctx = prepare(canvas, size), { ratio } = size;
    const right = area.left + area.width, bottom = area.top + area.height;
    if (selected) {
      ctx.fillStyle = colour("with");
      ctx.globalAlpha = 0.18;
      ctx.fillRect(selected.left, selected.top, selected.width, selected.height);
      ctx.globalAlpha = 1;
    }
    if (at) {
      straight(ctx, ratio, colour("soft"), [at.x, area.top], [at.x, bottom], [3, 3]);
      straight(ctx, ratio, colour("soft"), [area.left, at.y], [right, at.y], [3, 3]);
    }
    for (const { x, y, role } of dots) {
      ctx.beginPath();
      dot(ctx, x, y, RADIUS + 0.5);
      ctx.fillStyle = colour(role);
      ctx.strokeStyle = colour("paper");
      ctx.lineWidth = 1;
      ctx.fill();
      ctx.stroke();
    }
  };

  return { plot, cursor };
})();
