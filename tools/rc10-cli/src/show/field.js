// The base and the mechanisms from above: what the live page and the report draw with.
const Field = (() => {
  "use strict";
  const { stroke, text, style, ticks } = Plot;
  // The floor in a box: x to the right and y up, as long one way as the other; `wide` and `high` are its metres, around a place.
  const floor = (box, [x, y], [wide, high]) => {
    const scale = Math.min((box.right - box.left) / wide, (box.bottom - box.top) / high);
    const middle = [(box.left + box.right) / 2, (box.top + box.bottom) / 2];
    return { box, scale, to: ([a, b]) => [middle[0] + (a - x) * scale, middle[1] - (b - y) * scale],
      across: [box.left, box.right].map((at) => x + (at - middle[0]) / scale), up: [box.bottom, box.top].map((at) => y + (middle[1] - at) / scale) };
  };
  // Lines of whole lengths, with their metres.
  const grid = (pen, { box, to, across, up }) => {
    const count = (box.right - box.left) / 60;
    ticks(...across, count).forEach(([metres, words]) => {
      const [x] = to([metres, 0]);
      stroke(pen, [[x, box.top], [x, box.bottom]], style("rule"));
      pen.fillStyle = style("muted");
      text(pen, words, x, box.bottom + 4, "center", "top");
    });
    ticks(...up, count * (box.bottom - box.top) / (box.right - box.left)).forEach(([metres, words]) => {
      const [, y] = to([0, metres]);
      stroke(pen, [[box.left, y], [box.right, y]], style("rule"));
      pen.fillStyle = style("muted");
      text(pen, words, box.left - 4, y, "right", "middle");
    });
  };
  const turned = ([x, y, yaw], [a, b]) => [x + a * Math.cos(yaw) - b * Math.sin(yaw), y + a * Math.sin(yaw) + b * Math.cos(yaw)];
  const arrow = (pen, from, to, paint, width = 2) => {
    const angle = Math.atan2(to[1] - from[1], to[0] - from[0]), long = Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (long < 2) return;
    const head = (side) => [to[0] - 6 * Math.cos(angle + side), to[1] - 6 * Math.sin(angle + side)];
    stroke(pen, [from, to], paint, width);
    stroke(pen, [head(0.5), to, head(-0.5)], paint, width);
  };
  // The body at a pose by its wheels [x, y, direction, radius]; what each does: [steered, commanded, measured, slip], m/s.
  const base = (pen, { to, scale }, pose, wheels, rims, paint) => {
    const reach = [0, 1].map((axis) => Math.max(0.1, ...wheels.map((it) => Math.abs(it[axis]))));
    const corner = [[1, 1], [1, -1], [-1, -1], [-1, 1], [1, 1]].map(([x, y]) => to(turned(pose, [x * reach[0], y * reach[1]])));
    if (!rims) pen.setLineDash([4, 3]);
    stroke(pen, corner, style(paint), 1.5);
    pen.setLineDash([]);
    arrow(pen, to(pose), to(turned(pose, [1.3 * reach[0], 0])), style(paint), 2.5);
    if (rims) wheels.forEach(([x, y, direction, radius], at) => {
      const [steered, commanded, measured, slip] = rims[at] || [0], way = pose[2] + direction + steered, middle = turned(pose, [x, y]);
      const along = (metres) => to([middle[0] + metres * Math.cos(way), middle[1] + metres * Math.sin(way)]);
      const slips = slip !== null && slip !== undefined && Math.abs(slip) > 0.1;
      stroke(pen, [along(-radius), along(radius)], style(slips ? "bad" : "text"), Math.max(3, 0.05 * scale));
      // 0.4 m for 1 m/s.
      if (commanded) arrow(pen, to(middle), along(0.4 * commanded), style("line-1"), 4);
      if (measured) arrow(pen, to(middle), along(0.4 * measured), style("line-0"), 2);
      if (slips) arrow(pen, to(middle), along(-0.4 * slip), style("bad"), 2);
    });
  };
  // Mechanisms on a canvas, each in a square of its own, by the angles of their motors in degrees.
  const mechanisms = (canvas, all, angles) => {
    const { pen, width, height } = Plot.open(canvas), gap = 14, size = Math.min(height - 36, (width - 8) / all.length - gap), top = 4;
    all.forEach(({ label, kind, motors, span, links }, at) => {
      const left = 4 + at * (size + gap), middle = [left + size / 2, top + size / 2], known = motors.map((motor, index) => {
        const angle = angles[motor];
        return angle === null || angle === undefined ? null : angle - (links[index] || [0])[0];
      });
      stroke(pen, [[left, top], [left + size, top], [left + size, top + size], [left, top + size], [left, top]], style("rule"));
      pen.fillStyle = style("muted");
      text(pen, label, middle[0], top + size + 4, "center", "top");
      if (known.includes(null)) return;
      text(pen, known.map((it) => String(Math.round(it)).replace("-", "−") + "°").join("  "), middle[0], top + size + 17, "center", "top");
      if (kind === "bar") {
        const share = Math.max(0, Math.min(1, (known[0] - span[0]) / (span[1] - span[0]))), up = top + size * (1 - share);
        pen.fillStyle = style("line-0");
        pen.fillRect(left + size * 0.35, up, size * 0.3, size * share);
        stroke(pen, [[left + size * 0.2, up], [left + size * 0.8, up]], style("text"), 3);
        return;
      }
      // A turret is seen from above: ahead is up. An arm is seen from its side: its links' angles count on each other.
      let angle = kind === "turret" ? Math.PI / 2 : 0, spot = middle;
      const reach = links.reduce((sum, [, length]) => sum + length, 0);
      if (kind === "turret") stroke(pen, [middle, [middle[0], top]], style("rule"));
      links.forEach(([, length], index) => {
        angle += known[index] * Math.PI / 180;
        const long = 0.46 * size * length / reach, end = [spot[0] + long * Math.cos(angle), spot[1] - long * Math.sin(angle)];
        if (kind === "turret") arrow(pen, spot, end, style("line-0"), 3);
        else stroke(pen, [spot, end], style("line-" + index), 4);
        spot = end;
      });
    });
  };
  return { floor, grid, base, arrow, mechanisms, turned };
})();
