// Builds the plots of a report from the data in the page: frames, keys, zoom, values at the cursor, print.
(() => {
  "use strict";

  // Margins of the range of an axis, as shares: points at the ends are drawn completely.
  const MARGIN_X = 0.015, MARGIN_Y = 0.06;
  // Distance from the cursor within which a point of a line is read instead of the line [pixels].
  const REACH = 6;
  // Width of a plot on paper [pixels]: half of the printable width of the narrower of A4 and letter. Its resolution is
  // four dots per pixel, about 400 dots per inch.
  const PAPER = { width: 320, ratio: 4 };

  const root = document.documentElement;
  const pictures = JSON.parse(document.getElementById("pictures").textContent);
  let isPaper = false;

  const palette = () => {
    const style = getComputedStyle(root);
    return (name) => style.getPropertyValue("--" + name).trim();
  };
  const titled = ({ label, unit }) => (unit ? `${label} [${unit}]` : label);
  const number = (v) => Scales.digits(v, 4);
  const added = (parent, tag, className, text = "") => {
    const element = document.createElement(tag);
    element.className = className;
    element.textContent = text;
    parent.append(element);
    return element;
  };
  const heightOf = (width) => Math.round(Math.max(210, Math.min(330, 0.6 * width)));

  // Writes the elements of a plot into its frame. The canvas of the cursor is above the other one and has the focus.
  const frameOf = (figure, picture) => {
    const place = figure.querySelector(".plot");
    added(place, "p", "axis", titled(picture.y));
    const frame = added(place, "div", "frame");
    const drawing = added(frame, "canvas", "drawing"), cursor = added(frame, "canvas", "cursor");
    added(place, "p", "axis across", titled(picture.x));
    const reset = added(place, "button", "reset", "reset zoom");
    reset.type = "button";
    const readout = added(place, "output", "readout");
    // A picture has no readable contents, but the frame has a button.
    drawing.setAttribute("aria-hidden", "true");
    cursor.setAttribute("role", "img");
    cursor.setAttribute("aria-label", place.getAttribute("aria-label"));
    cursor.setAttribute("aria-keyshortcuts", "+ - ArrowLeft ArrowRight Escape");
    cursor.tabIndex = 0;
    place.removeAttribute("role");
    place.removeAttribute("aria-label");
    return { place, frame, drawing, cursor, reset, readout };
  };

  // Makes the names in the key of a figure buttons that hide and show their curves.
  const keyOf = (figure, curves, changed) => {
    figure.querySelectorAll(".key li").forEach((item, i) => {
      const button = document.createElement("button");
      button.type = "button";
      button.append(...item.childNodes);
      item.append(button);
      const set = (isHidden) => {
        curves[i].isHidden = isHidden;
        button.setAttribute("aria-pressed", String(!isHidden));
      };
      set(false);
      button.addEventListener("click", () => {
        set(!curves[i].isHidden);
        changed();
      });
    });
  };

  const build = (figure, picture) => {
    const elements = frameOf(figure, picture), { place, frame, cursor } = elements;
    const curves = picture.curves.map(Curves.read);
    // Of functions, x is zoomed and y follows. Of loops, both axes are zoomed.
    const both = !curves.every((curve) => curve.isFunction);
    const logs = [picture.x.log, picture.y.log];
    // Zoomed ranges of x and y; null is the whole range.
    let view = [null, null];
    let size = null, drawn = null, at = null, selected = null, requested = 0;

    const shown = () => {
      const list = curves.filter((curve) => !curve.isHidden);
      return list.length ? list : curves;
    };
    const wholeX = Scales.padded(Curves.union(curves.map((c) => Curves.extent(c.x, logs[0]))), logs[0], MARGIN_X);
    const rangeY = (x) => Scales.padded(Curves.union(shown().map((c) => Curves.visible(c, x, logs[1]))), logs[1], MARGIN_Y);
    const whole = () => [wholeX, rangeY(Scales.scale(wholeX, logs[0]))];
    const isZoomed = () => view.some(Boolean);

    const draw = () => {
      cancelAnimationFrame(requested);
      // A hidden page has no width.
      if (!size) return;
      const [rangeX, zoomedY] = isPaper ? [null, null] : view;
      const x = Scales.scale(rangeX ?? wholeX, logs[0]);
      const y = Scales.scale(zoomedY ?? rangeY(x), logs[1]);
      const contents = {
        x, y, curves: curves.filter((curve) => !curve.isHidden), marked: picture.marks ?? [], degrees: picture.x.unit === "°",
      };
      drawn = { x, y, ...Drawing.plot(elements.drawing, size, contents, palette()) };
      read();
    };
    const later = () => {
      cancelAnimationFrame(requested);
      requested = requestAnimationFrame(draw);
    };

    // Shows the values at the cursor as text and as points on their curves. Of a loop, x alone determines no value: the
    // text is the position of the cursor.
    const read = () => {
      const { area, x, y, toX, toY } = drawn;
      const dots = [], values = [];
      if (at) {
        const valueX = x.value((at.x - area.left) / area.width);
        const valueY = y.value(1 - (at.y - area.top) / area.height);
        const place = `${number(valueX)} ${picture.x.unit}`.trim();
        if (both) values.push(number(valueY));
        for (const curve of both ? [] : curves.filter((c) => !c.isHidden)) {
          const point = Curves.at(curve, valueX, x, y.log, REACH / area.width);
          if (!point || point.x < x.min || point.x > x.max) continue;
          values.push(`${curve.name} ${number(point.y)}`);
          dots.push({ x: toX(point.x), y: toY(point.y), role: curve.role });
        }
        elements.readout.textContent = `${place}: ${values.join(", ")} ${picture.y.unit}`;
      } else {
        elements.readout.textContent = "";
      }
      Drawing.cursor(cursor, size, area, { at, dots, selected }, palette());
    };

    const zoom = (ranges) => {
      view = ranges;
      place.classList.toggle("zoomed", isZoomed());
      place.classList.toggle("loops", both);
      // The button disappears with the zoom; the focus stays in the plot.
      if (!isZoomed() && document.activeElement === elements.reset) cursor.focus({ preventScroll: true });
      later();
    };
    const move = (from, to, factor) => {
      const all = both ? whole() : [wholeX, null];
      zoom(all.map((range, c) => range && Scales.moved(view[c] ?? range, range, logs[c], from[c], to[c], factor)));
    };
    // Enlarges a selected rectangle of the plot.
    const show = ({ left, top, width, height }) => {
      const { area } = drawn, all = both ? whole() : [wholeX, null];
      const starts = [(left - area.left) / area.width, 1 - (top + height - area.top) / area.height];
      const sizes = [width / area.width, height / area.height];
      zoom(all.map((range, c) => range && Scales.moved(view[c] ?? range, range, logs[c], starts[c], 0, sizes[c])));
    };
    const reset = () => zoom([null, null]);
    const hover = (point) => {
      at = point;
      read();
    };
    const select = (rectangle) => {
      selected = rectangle;
      read();
    };
    elements.reset.addEventListener("click", reset);
    keyOf(figure, curves, later);

    // Sets the size: on paper that of a column, else that of the frame.
    const fit = () => {
      const width = isPaper ? PAPER.width : Math.floor(frame.clientWidth);
      const ratio = isPaper ? PAPER.ratio : Math.max(1, devicePixelRatio);
      if (width <= 0 || (size && width === size.width && ratio === size.ratio)) return;
      size = { width, height: heightOf(width), ratio };
      at = null;
      draw();
    };
    fit();
    Gestures.listen(cursor, { area: () => drawn.area, hover, select, show, move, isZoomed, reset }, both);
    return { frame, fit, draw };
  };

  const plots = [...document.querySelectorAll("figure[data-picture]")].map((figure) => build(figure, pictures[+figure.dataset.picture]));

  const fitAll = () => plots.forEach((plot) => plot.fit());
  addEventListener("resize", fitAll);
  // Other changes of the width. In the next frame, because a plot that grows moves other plots.
  const widths = new ResizeObserver(() => requestAnimationFrame(fitAll));
  plots.forEach((plot) => widths.observe(plot.frame));
  // The window moves to a screen with another resolution.
  const watchResolution = () => {
    fitAll();
    matchMedia(`(resolution: ${devicePixelRatio}dppx)`).addEventListener("change", watchResolution, { once: true });
  };
  watchResolution();

  // Pages are printed light, with the whole range of every plot.
  const onPaper = (is) => {
    if (is === isPaper) return;
    isPaper = is;
    root.classList.toggle("paper", is);
    fitAll();
  };
  addEventListener("beforeprint", () => onPaper(true));
  addEventListener("afterprint", () => onPaper(false));
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => plots.forEach((plot) => plot.draw()));
})();
