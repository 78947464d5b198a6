// Bode plot of a speed loop: gain in dB over phase in degrees, over frequencies in Hz. Each curve has a name, `hz`, `db` and `deg`;
// what was measured is drawn as points, what is computed as lines.
const Bode = (() => {
  "use strict";
  const HZ = [1, 100], DB = [-40, 40], DEG = [-270, 0];
  const half = (pen, box, [low, high], step, unit, curves, of) => {
    const across = Plot.across(box, HZ.map(Math.log10)), x = (hz) => across(Math.log10(hz)), y = Plot.up(box, [low, high]);
    pen.fillStyle = Plot.style("muted");
    for (let value = low; value <= high; value += step) {
      Plot.stroke(pen, [[box.left, y(value)], [box.right, y(value)]], Plot.style("rule"));
      Plot.text(pen, String(value).replace("-", "−"), box.left - 6, y(value), "right", "middle");
    }
    for (const hz of [1, 2, 5, 10, 20, 50, 100]) {
      Plot.stroke(pen, [[x(hz), box.top], [x(hz), box.bottom]], Plot.style("rule"));
      Plot.text(pen, String(hz), x(hz), box.bottom + 4, "center", "top");
    }
    Plot.text(pen, unit, box.left + 4, box.top + 2, "left", "top");
    // Where a margin is read: a gain of one, half a turn.
    const mark = of === "db" ? 0 : -180;
    Plot.stroke(pen, [[box.left, y(mark)], [box.right, y(mark)]], Plot.style("muted"));
    Plot.inside(pen, box, () => curves.forEach((it, place) => {
      const paint = Plot.colour(Math.floor(place / 2)), spot = (k) => [x(it.hz[k]), y(it[of][k])];
      if (!it.measured) return Plot.trace(pen, [0, it.hz.length - 1], spot, { paint, width: 1.5 });
      pen.fillStyle = paint;
      it.hz.forEach((_, k) => { const [left, top] = spot(k); pen.fillRect(left - 2.5, top - 2.5, 5, 5); });
    }));
  };
  // `curves`: for each set of gains the computed one and the measured one.
  const draw = (canvas, legend, curves) => {
    canvas.hidden = !curves.length;
    legend.replaceChildren(...curves.filter((it) => it.hz.length).map((it) => {
      const name = document.createElement("span"), sign = document.createElement("i"), place = curves.indexOf(it);
      sign.style.background = Plot.colour(Math.floor(place / 2));
      if (it.measured) sign.className = "block";
      name.append(sign, it.name);
      return name;
    }));
    if (!curves.length) return;
    const { pen, width, height } = Plot.open(canvas), middle = (height - 56) / 2;
    const box = (top) => ({ left: 40, top, right: width - 14, bottom: top + middle });
    half(pen, box(8), DB, 20, "dB", curves, "db");
    half(pen, box(middle + 32), DEG, 90, "deg", curves, "deg");
  };
  return { draw };
})();
