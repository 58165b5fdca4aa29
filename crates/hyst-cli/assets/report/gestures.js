// Mouse, touch and keyboard on a plot. Mouse: drag to zoom, double-click to reset. Touch: two fingers zoom, one finger
// moves a zoomed plot, a vertical swipe scrolls the page, a double tap resets. Keys: + and - zoom, arrows move, Escape
// resets.
const Gestures = (() => {
  "use strict";

  // Shortest drag that is a selection, and the shortest extent of a selection in both directions [pixels].
  const MIN_DRAG = 5, MIN_BOTH = 20;
  // Time between the taps of a double tap [ms], and distance that a tap may move [pixels].
  const DOUBLE_TAP = 350, TAP_MOVE = 10;

  const clamped = (v, low, high) => Math.min(Math.max(v, low), high);

  // Place of an event on the canvas in pixels, within the plot.
  const inside = (e, canvas, { left, top, width, height }) => {
    const box = canvas.getBoundingClientRect();
    return { x: clamped(e.clientX - box.left, left, left + width), y: clamped(e.clientY - box.top, top, top + height) };
  };

  // Returns the selected rectangle, or null for a click. A narrow or flat one selects the whole other direction; a plot
  // of functions selects x only.
  const rectangle = (a, b, area, both) => {
    const [dx, dy] = [Math.abs(b.x - a.x), Math.abs(b.y - a.y)];
    if (Math.max(dx, both ? dy : 0) < MIN_DRAG) return null;
    const wide = !both || dx >= MIN_BOTH || dx >= dy, tall = both && (dy >= MIN_BOTH || dy > dx);
    return {
      ...(wide ? { left: Math.min(a.x, b.x), width: dx } : { left: area.left, width: area.width }),
      ...(tall ? { top: Math.min(a.y, b.y), height: dy } : { top: area.top, height: area.height }),
    };
  };

  // The handlers of `plot` are: area() returns the place between the axes, hover(place or null), select(rectangle or null),
  // show(rectangle), move(from, to, factor) with places as shares of the plot, isZoomed() and reset().
  const mouse = (canvas, plot, both) => {
    let start = null;
    canvas.addEventListener("pointermove", (e) => {
      if (e.pointerType === "touch" || start) return;
      const box = canvas.getBoundingClientRect(), at = inside(e, canvas, plot.area());
      const isInside = at.x === e.clientX - box.left && at.y === e.clientY - box.top;
      plot.hover(isInside ? at : null);
    });
    canvas.addEventListener("pointerleave", (e) => e.pointerType !== "touch" && !start && plot.hover(null));

    // A drag continues outside of the canvas, so the window reports it.
    const drag = (e) => {
      const at = inside(e, canvas, plot.area());
      plot.hover(at);
      plot.select(rectangle(start, at, plot.area(), both));
    };
    const end = (e) => {
      const selected = e.type === "pointerup" ? rectangle(start, inside(e, canvas, plot.area()), plot.area(), both) : null;
      stop();
      if (e.target !== canvas) plot.hover(null);
      if (selected) plot.show(selected);
    };
    const key = (e) => e.key === "Escape" && stop();
    const listeners = { pointermove: drag, pointerup: end, pointercancel: end, keydown: key };
    const stop = () => {
      start = null;
      for (const [name, handler] of Object.entries(listeners)) removeEventListener(name, handler);
      plot.select(null);
    };
    canvas.addEventListener("pointerdown", (e) => {
      if (e.pointerType === "touch" || e.button !== 0 || start) return;
      start = inside(e, canvas, plot.area());
      for (const [name, handler] of Object.entries(listeners)) addEventListener(name, handler);
    });
    canvas.addEventListener("dblclick", () => plot.reset());
  };

  const touch = (canvas, plot) => {
    const fingers = new Map();
    let before = null, down = null, tapped = -Infinity;
    const place = (e) => {
      const box = canvas.getBoundingClientRect(), { left, top, width, height } = plot.area();
      return [(e.clientX - box.left - left) / width, 1 - (e.clientY - box.top - top) / height];
    };
    // Middle of the fingers and, of two fingers, their distance.
    const state = () => {
      const points = [...fingers.values()];
      const middle = [0, 1].map((c) => points.reduce((sum, p) => sum + p[c], 0) / points.length);
      const reach = points.length > 1 ? Math.hypot(points[0][0] - points[1][0], points[0][1] - points[1][1]) : null;
      return { middle, reach: reach && Math.max(0.05, reach) };
    };
    canvas.addEventListener("pointerdown", (e) => {
      if (e.pointerType !== "touch") return;
      fingers.set(e.pointerId, place(e));
      before = state();
      down = fingers.size === 1 ? { x: e.clientX, y: e.clientY } : null;
      plot.hover(down && inside(e, canvas, plot.area()));
    });
    canvas.addEventListener("pointermove", (e) => {
      if (!fingers.has(e.pointerId)) return;
      fingers.set(e.pointerId, place(e));
      const now = state();
      const factor = now.reach && before.reach ? before.reach / now.reach : 1;
      if (factor !== 1 || plot.isZoomed()) {
        plot.hover(null);
        plot.move(before.middle, now.middle, factor);
      } else if (fingers.size === 1) {
        plot.hover(inside(e, canvas, plot.area()));
      }
      before = now;
    });
    const end = (e) => {
      if (!fingers.delete(e.pointerId)) return;
      if (fingers.size) before = state();
      const isTap = e.type === "pointerup" && down && Math.hypot(e.clientX - down.x, e.clientY - down.y) < TAP_MOVE;
      if (isTap && e.timeStamp - tapped < DOUBLE_TAP) plot.reset();
      tapped = isTap ? e.timeStamp : -Infinity;
    };
    for (const name of ["pointerup", "pointercancel"]) canvas.addEventListener(name, end);
  };

  const keyboard = (canvas, plot, both) => {
    const middle = [0.5, 0.5];
    const moves = { ArrowLeft: [0.6, 0.5], ArrowRight: [0.4, 0.5], ...(both && { ArrowUp: [0.5, 0.4], ArrowDown: [0.5, 0.6] }) };
    canvas.addEventListener("keydown", (e) => {
      if (e.ctrlKey || e.altKey || e.metaKey) return;
      if (e.key === "+" || e.key === "=") plot.move(middle, middle, 0.5);
      else if (e.key === "-") plot.move(middle, middle, 2);
      else if (e.key === "Escape") plot.reset();
      else if (moves[e.key] && plot.isZoomed()) plot.move(middle, moves[e.key], 1);
      else return;
      e.preventDefault();
    });
  };

  // Listens on a canvas; `both` is whether a zoom changes both axes.
  const listen = (canvas, plot, both) => {
    mouse(canvas, plot, both);
    touch(canvas, plot);
    keyboard(canvas, plot, both);
  };

  return { listen };
})();
