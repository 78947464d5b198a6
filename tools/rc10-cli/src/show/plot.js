// Plots on a canvas: what the report and the live page draw with. Colours are variables of the page's style.
const Plot = (() => {
  "use strict";
  const COLOURS = 8, FONT = "11px system-ui, sans-serif";
  let ink = {};

  const nice = (rough) => {
    const power = 10 ** Math.floor(Math.log10(rough)), share = rough / power;
    return power * (share < 1.4 ? 1 : share < 3.2 ? 2 : share < 7 ? 5 : 10);
  };
  const digits = (step) => Math.max(0, -Math.floor(Math.log10(step) + 1e-9));
  // Round values of a range, about so many, with their texts.
  const ticks = (low, high, count) => {
    const step = nice(Math.max(high - low, 1e-9) / Math.max(count, 1)), all = [];
    for (let n = Math.ceil(low / step - 1e-6); n * step <= high + step * 1e-6; n++) {
      all.push([n * step, (n * step).toFixed(digits(step)).replace(/^-(?=0(\.0*)?$)/, "").replace("-", "−")]);
    }
    return all;
  };
  const style = (name) => ink[name] ??= getComputedStyle(document.documentElement).getPropertyValue("--" + name).trim();
  const line = (index) => "line-" + (index % COLOURS);
  const colour = (index) => style(line(index));
  // The variable of a state's colour: by its meaning where it has one, green for what drives, blue for what holds, amber for
  // what coasts, red for what is lost; any other by its number.
  const MEANINGS = "run hold brake coast off lost unheard armed suspended stopped disarmed heard driven".split(" ");
  const SAME = { online: "run", active: "run", ready: "run", neverseen: "unheard", estopped: "stopped", fault: "lost", interrupted: "suspended", passive: "suspended", busoff: "lost" };
  const state = (name, index = 0) => {
    const word = String(name).toLowerCase(), meaning = SAME[word] || word;
    return MEANINGS.includes(meaning) ? "state-" + meaning : "shade-" + index % COLOURS;
  };
  // After the style has changed.
  const restyle = () => { ink = {}; };

  // A canvas cleared and scaled to the screen's pixels.
  const open = (canvas) => {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    pen.scale(ratio, ratio);
    pen.font = FONT;
    pen.lineJoin = "round";
    return { pen, width, height };
  };
  const text = (pen, words, x, y, align, baseline, widest) => {
    pen.textAlign = align;
    pen.textBaseline = baseline;
    pen.fillText(Lang.tr(words), x, y, widest);
  };
  const stroke = (pen, points, paint, width = 1) => {
    pen.strokeStyle = paint;
    pen.lineWidth = width;
    pen.beginPath();
    points.forEach(([x, y], index) => (index ? pen.lineTo(x, y) : pen.moveTo(x, y)));
    pen.stroke();
  };
  const inside = (pen, box, draw) => {
    pen.save();
    pen.beginPath();
    pen.rect(box.left, box.top, box.right - box.left, box.bottom - box.top);
    pen.clip();
    draw();
    pen.restore();
  };

  // From values to places: of times from left to right, of others from the bottom up.
  const across = (box, [from, to]) => (time) => box.left + (time - from) / (to - from) * (box.right - box.left);
  const up = (box, [low, high]) => (value) => box.bottom - (value - low) / (high - low) * (box.bottom - box.top);

  const timeAxis = (pen, box, [from, to], named) => {
    const x = across(box, [from, to]);
    ticks(from, to, (box.right - box.left) / 60).forEach(([time, words]) => {
      stroke(pen, [[x(time), box.bottom], [x(time), box.bottom + 4]], style("muted"));
      pen.fillStyle = style("muted");
      // The last one is not cut at the edge.
      const most = pen.canvas.clientWidth - pen.measureText(words).width / 2 - 1;
      text(pen, words, Math.min(x(time), most), box.bottom + 7, "center", "top");
    });
    if (named) text(pen, "time / s", box.right, box.bottom + 20, "right", "top");
  };
  const valueAxis = (pen, box, [low, high], unit) => {
    const y = up(box, [low, high]);
    ticks(low, high, (box.bottom - box.top) / 34).forEach(([value, words]) => {
      stroke(pen, [[box.left, y(value)], [box.right, y(value)]], style("rule"));
      pen.fillStyle = style("muted");
      text(pen, words, box.left - 6, y(value), "right", "middle");
    });
    text(pen, unit, box.left - 6, box.top - 3, "right", "bottom");
  };

  // Where there are no data.
  const hatch = (pen, box) => inside(pen, box, () => {
    const height = box.bottom - box.top;
    for (let x = box.left - height; x < box.right; x += 8) stroke(pen, [[x, box.bottom], [x + height, box.top]], style("muted"), 0.5);
  });
  // A moment in a plot, with its words where there is room.
  const moment = (pen, box, x, words, paint) => {
    pen.setLineDash([3, 3]);
    stroke(pen, [[x, box.top], [x, box.bottom]], style(paint));
    pen.setLineDash([]);
    pen.fillStyle = style(paint);
    if (words) text(pen, words, x + 3, box.top + 1, "left", "top", 120);
  };

  // One line through points from one number to another; it breaks where `point` has none, and where `joins` says.
  const trace = (pen, [first, last], point, { paint, width = 1.6, dash = [], stairs = false, joins = () => true }) => {
    let before = null;
    pen.strokeStyle = paint;
    pen.lineWidth = width;
    pen.setLineDash(dash);
    pen.beginPath();
    for (let index = first; index <= last; index++) {
      const spot = point(index);
      if (spot) {
        pen[before !== null && joins(before, index) ? "lineTo" : "moveTo"](...spot);
        const next = stairs && point(index, index + 1);
        if (next) pen.lineTo(...next);
      }
      before = spot ? index : null;
    }
    pen.stroke();
    pen.setLineDash([]);
  };

  // A lane of states: its name, and a block for each run of one, in its paint and with its words where there is room.
  const lane = (pen, box, x, [top, height], name, runs, paint = "text") => {
    pen.fillStyle = style(paint);
    text(pen, name, box.left - 8, top + height / 2 + 1, "right", "middle", box.left - 10);
    inside(pen, box, () => runs.forEach(({ from, to, paint, words }) => {
      const left = Math.max(box.left, x(from)), right = Math.min(box.right, x(to));
      pen.fillStyle = style(paint);
      pen.fillRect(left, top, Math.max(right - left, 0.5) + 0.3, height);
      if (!words || right - left < pen.measureText(Lang.tr(words)).width + 8) return;
      // These are dark by day, too.
      pen.fillStyle = /lost|unheard|stopped/.test(paint) ? "#fff" : style("text");
      text(pen, words, left + 4, top + height / 2 + 1, "left", "middle");
    }));
  };

  return { FONT, ticks, style, line, colour, state, restyle, open, text, stroke, inside, across, up, timeAxis, valueAxis, hatch, moment, trace, lane };
})();
