// Draws the plots of the report. Everything it needs is in the element "data".
(() => {
  "use strict";
  const data = JSON.parse(document.getElementById("data").textContent);
  const { FONT, ticks, style, line, colour, restyle, open, text, stroke, inside, up, timeAxis, valueAxis, lane } = Plot;
  const LANE = 15, SLANT = Math.PI / 3, WIDEST = 170, CROWDED = 13;
  const whole = [0, Math.max(data.length, data.period)];
  let view = whole, cursor = null;

  // ---- small things ----------------------------------------------------------------------------
  const element = (tag, parent, name, text) => {
    const made = document.createElement(tag);
    if (name) made.className = name;
    if (text !== undefined) made.textContent = text;
    return parent.appendChild(made);
  };
  const clamp = (value, low, high) => Math.min(Math.max(value, low), high);
  const show = (value, places) => (value == null ? "–" : value.toFixed(places).replace("-", "−"));
  // Lowest and highest value of a sample: `below` and `above` are hundredths.
  const bounds = ({ measured, below, above }, index) => {
    const mean = measured[index];
    return mean == null ? [null, null] : [mean - (below?.[index] ?? 0) / 100, mean + (above?.[index] ?? 0) / 100];
  };

  // ---- what all time plots share ---------------------------------------------------------------
  const across = (box) => Plot.across(box, view);
  const shade = (pen, box, x) => inside(pen, box, () => data.stops.forEach(([from, to]) => {
    pen.fillStyle = style("stop");
    pen.fillRect(x(from), box.top, x(to) - x(from), box.bottom - box.top);
  }));
  // Of more events than have room, only some lines and no names: those that were injected stay.
  const marks = (x, box) => {
    const all = data.events.map(([time, label, injected], index) => ({ time, x: x(time), label, injected, number: String(index + 1) }))
      .filter(({ time }) => time >= view[0] && time <= view[1]);
    if (all.length * CROWDED <= box.right - box.left) return all;
    let free = -Infinity;
    return all.filter((event) => event.injected || (event.x >= free && (free = event.x + 2 * CROWDED)))
      .map((event) => (event.injected ? event : { ...event, label: "", number: "" }));
  };
  const eventLines = (pen, box, events) => {
    pen.setLineDash([2, 3]);
    events.forEach(({ x, injected }) => stroke(pen, [[x, box.top], [x, box.bottom]], style(injected ? "bad" : "event")));
    pen.setLineDash([]);
  };
  // The name of an event where there is room, else its number, else only its line.
  const flags = (pen, box, events) => {
    let free = -Infinity;
    pen.font = "10px system-ui, sans-serif";
    events.forEach(({ x, label, number }, index) => {
      const room = (index + 1 < events.length ? events[index + 1].x : box.right) - x;
      const words = [label, number].find((one) => pen.measureText(one).width + 5 < room) || number;
      if (x < free) return;
      pen.fillStyle = style("muted");
      text(pen, words, x, box.top - 3, "left", "bottom");
      free = x + pen.measureText(words).width + 3;
    });
    pen.font = FONT;
  };

  // ---- values over time ------------------------------------------------------------------------
  class TimePlot {
    constructor(canvas) {
      this.canvas = canvas;
      canvas.tabIndex = 0;
      this.holder = canvas.parentElement;
      this.holder.classList.add("time");
      this.legend = canvas.closest("figure").querySelector(".legend");
      this.line = element("div", this.holder, "cursor");
      this.clock = element("span", this.line);
      this.selection = element("div", this.holder, "selection");
      this.listen();
    }
    place(box) {
      this.box = box;
      for (const part of [this.line, this.selection]) {
        part.style.top = box.top + "px";
        part.style.height = box.bottom - box.top + "px";
      }
    }
    time(event) {
      const x = event.clientX - this.canvas.getBoundingClientRect().left;
      const share = (x - this.box.left) / (this.box.right - this.box.left);
      return view[0] + clamp(share, 0, 1) * (view[1] - view[0]);
    }
    listen() {
      let start = null;
      const select = (end) => {
        const x = across(this.box), [from, to] = [Math.min(start, end), Math.max(start, end)];
        this.selection.style.left = x(from) + "px";
        this.selection.style.width = x(to) - x(from) + "px";
        this.selection.style.visibility = x(to) - x(from) > 4 ? "visible" : "hidden";
        return x(to) - x(from) > 4 && to - from >= 2 * data.period ? [from, to] : null;
      };
      const stop = () => {
        start = null;
        this.selection.style.visibility = "hidden";
      };
      this.holder.addEventListener("pointerdown", (event) => {
        if (event.button !== 0) return;
        start = this.time(event);
        this.holder.setPointerCapture(event.pointerId);
        point(start);
      });
      this.holder.addEventListener("pointermove", (event) => {
        point(this.time(event));
        if (start !== null) select(cursor);
      });
      this.holder.addEventListener("pointerup", (event) => {
        const wanted = start === null ? null : select(this.time(event));
        stop();
        if (wanted) zoom(wanted);
      });
      this.holder.addEventListener("pointercancel", stop);
      this.holder.addEventListener("pointerleave", (event) => event.pointerType === "mouse" && point(null));
      this.holder.addEventListener("dblclick", () => zoom(whole));
      this.canvas.addEventListener("keydown", (event) => {
        if (event.ctrlKey || event.altKey || event.metaKey) return;
        const [from, to] = view, middle = cursor !== null && cursor >= from && cursor <= to ? cursor : (from + to) / 2;
        const scaled = (factor) => [middle - (middle - from) * factor, middle + (to - middle) * factor];
        const moved = (share) => [from + share * (to - from), to + share * (to - from)];
        const keys = { "+": () => scaled(0.5), "=": () => scaled(0.5), "-": () => scaled(2), ArrowLeft: () => moved(-0.2), ArrowRight: () => moved(0.2), "0": () => whole };
        if (!keys[event.key]) return;
        event.preventDefault();
        zoom(keys[event.key]());
      });
    }
    point() {
      const seen = cursor !== null && cursor >= view[0] && cursor <= view[1];
      this.line.style.visibility = seen ? "visible" : "hidden";
      if (seen) {
        this.line.style.left = across(this.box)(cursor) + "px";
        this.clock.textContent = cursor.toFixed(2) + " s";
      }
      this.read(seen);
    }
  }

  class Chart extends TimePlot {
    constructor(canvas, chart) {
      super(canvas);
      this.chart = chart;
      this.hidden = new Set();
      // Room for the longest value, so that nothing moves while values are shown.
      const longest = ({ measured, target = [] }) =>
        [...measured, ...target].reduce((most, value) => Math.max(most, show(value, chart.places).length), 1);
      const paired = chart.series.some(({ target }) => target);
      const room = Math.max(...chart.series.map(longest)) * (paired ? 2 : 1);
      this.outputs = chart.series.map(({ name }, index) => {
        const button = element("button", this.legend);
        button.type = "button";
        button.setAttribute("aria-pressed", "true");
        element("i", button).style.background = `var(--${line(index)})`;
        element("span", button, "", name);
        button.addEventListener("click", () => {
          if (!this.hidden.delete(index)) this.hidden.add(index);
          button.setAttribute("aria-pressed", String(!this.hidden.has(index)));
          this.draw();
        });
        const output = element("output", button);
        output.style.minWidth = room + (paired ? 3 : 1) + chart.unit.length + "ch";
        return output;
      });
      if (chart.series.some(({ before }) => before)) {
        const item = element("span", this.legend, "before");
        element("i", item).style.background = "var(--muted)";
        element("span", item, "", "the earlier run (dashed)");
      }
    }
    shown() {
      return this.chart.series.map((series, index) => ({ ...series, index })).filter(({ index }) => !this.hidden.has(index));
    }
    // Lowest and highest of what is in view, with some air.
    range(first, last) {
      let low = Infinity, high = -Infinity;
      const see = (value) => {
        if (value == null) return;
        low = Math.min(low, value);
        high = Math.max(high, value);
      };
      for (const series of this.shown()) {
        for (let index = first; index <= last; index++) {
          bounds(series, index).forEach(see);
          see(series.target?.[index]);
          see(series.before?.[index]);
        }
      }
      if (this.chart.plan) [0, 100, ...this.chart.plan].forEach(see);
      if (low > high) [low, high] = [0, 1];
      const air = Math.max((high - low) * 0.06, this.chart.least / 2);
      return [this.chart.plan ? low : low - air, high + air];
    }
    draw() {
      const { pen, width, height } = open(this.canvas), { chart } = this;
      const box = { left: 46, top: 22, right: width - 8, bottom: height - 36 };
      this.place(box);
      const x = across(box), { from, step } = chart;
      const first = Math.max(0, Math.floor((view[0] - from) / step) - 1), last = Math.ceil((view[1] - from) / step) + 1;
      const [low, high] = this.range(first, last);
      const y = up(box, [low, high]);
      shade(pen, box, x);
      valueAxis(pen, box, [low, high], chart.unit);
      timeAxis(pen, box, view, true);
      const events = marks(x, box);
      eventLines(pen, box, events);
      flags(pen, box, events);
      inside(pen, box, () => {
        if (chart.plan) this.drawPlan(pen, box, y);
        for (const series of this.shown()) {
          const { measured, target, before, index } = series;
          if (before) this.trace(pen, before, x, y, [first, last], { paint: style("muted"), width: 1.2, dash: [3, 3] });
          this.envelope(pen, series, x, y, first, last);
          this.trace(pen, measured, x, y, [first, last], { paint: colour(index) });
          if (target) this.trace(pen, target, x, y, [first, last], { paint: colour(index), width: 1.2, dash: [6, 4] });
        }
      });
      this.point();
    }
    drawPlan(pen, box, y) {
      const [least, typical, worst] = this.chart.plan;
      pen.fillStyle = style("band");
      pen.fillRect(box.left, y(worst), box.right - box.left, y(least) - y(worst));
      pen.setLineDash([6, 4]);
      stroke(pen, [[box.left, y(typical)], [box.right, y(typical)]], style("line-0"));
      pen.setLineDash([]);
      stroke(pen, [[box.left, y(100)], [box.right, y(100)]], style("bad"));
      pen.fillStyle = style("muted");
      const label = (words, value, baseline) => text(pen, `${words} ${value.toFixed(0)} %`, box.right - 4, y(value), "right", baseline);
      label("planned at worst", worst, "bottom");
      label("at least", least, "top");
    }
    // From the lowest to the highest value of each sample, where they are apart.
    envelope(pen, series, x, y, first, last) {
      const { from, step } = this.chart, half = Math.max(x(step) - x(0), 1) / 2;
      pen.fillStyle = colour(series.index);
      pen.globalAlpha = 0.3;
      for (let index = first; index <= Math.min(last, series.measured.length - 1); index++) {
        const [low, high] = bounds(series, index);
        // Around the mean, which stands for the same time.
        const middle = x(from + index * step);
        if (low !== null && high > low) pen.fillRect(middle - half, y(high), 2 * half, y(low) - y(high));
      }
      pen.globalAlpha = 1;
    }
    // One line; it breaks where there is no value, and where an angle goes round.
    trace(pen, values, x, y, [first, last], how) {
      const { from, step, wraps, stairs } = this.chart;
      const point = (index, until = index) => (values[index] == null ? null : [x(from + until * step), y(values[index])]);
      const joins = (one, other) => !(wraps && Math.abs(values[other] - values[one]) > 180);
      Plot.trace(pen, [first, Math.min(last, values.length - 1)], point, { ...how, stairs, joins });
    }
    read(seen) {
      const { from, step, stairs, series, places, unit } = this.chart;
      const index = Math[stairs ? "floor" : "round"]((cursor - from) / step);
      series.forEach(({ measured, target }, number) => {
        const goal = target && target[index] != null ? " → " + show(target[index], places) : "";
        const [low, high] = seen ? bounds(series[number], index) : [null, null];
        const apart = low !== null && show(low, places) !== show(high, places);
        const range = apart ? ` (${show(low, places)} .. ${show(high, places)})` : "";
        this.outputs[number].textContent = seen ? show(measured[index], places) + range + goal + " " + unit : "";
      });
    }
  }

  // ---- states of the motors, and the names of the events ---------------------------------------
  class Timeline extends TimePlot {
    constructor(canvas) {
      super(canvas);
      const used = new Set(data.lanes.flatMap(({ runs }) => runs.map(([, , state]) => state)));
      data.states.forEach((state, index) => {
        if (!used.has(index)) return;
        const item = element("span", this.legend);
        element("i", item, "block").style.background = `var(--${Plot.state(state)})`;
        item.append(state === "unheard" ? "never heard" : state);
      });
      this.output = element("output", element("span", this.legend, "whole"));
      const pen = canvas.getContext("2d");
      pen.font = FONT;
      const longest = (all) => Math.max(0, ...all.map((words) => pen.measureText(words).width));
      this.left = longest(data.lanes.map(({ name }) => name)) + 12;
      this.top = Math.min(WIDEST, longest(data.events.map(([, label]) => "00 " + label))) * Math.sin(SLANT) + 22;
      canvas.style.height = this.top + data.lanes.length * LANE + 38 + "px";
    }
    draw() {
      const { pen, width, height } = open(this.canvas);
      const box = { left: this.left, top: this.top, right: width - 48, bottom: height - 36 };
      this.place(box);
      const x = across(box), events = marks(x, box);
      data.lanes.forEach(({ name, runs, bad }, number) => {
        const named = runs.map(([from, to, state]) => ({ from, to, paint: Plot.state(data.states[state]) }));
        const top = box.top + number * LANE + 3;
        if (bad) {
          pen.fillStyle = style("bad-back");
          pen.fillRect(0, top - 2, width, LANE);
        }
        lane(pen, box, x, [top, LANE - 4], name, named, bad ? "bad" : "text");
      });
      timeAxis(pen, box, view, true);
      eventLines(pen, box, events);
      this.names(pen, box, events);
      this.point();
    }
    // The events' names, slanted, moved apart where their marks are close together.
    names(pen, box, events) {
      const gap = 13, end = box.right + 8;
      const shown = events.filter(({ label }) => label).map((event) => ({ ...event, at: event.x }));
      shown.forEach((event, index) => index && (event.at = Math.max(event.x, shown[index - 1].at + gap)));
      for (let index = shown.length - 1, most = end; index >= 0; index--, most -= gap) {
        shown[index].at = most = Math.min(shown[index].at, most);
      }
      if (shown.length < events.length) {
        pen.fillStyle = style("muted");
        text(pen, "zoom in for the names of the events", box.left, box.top - 6, "left", "bottom");
      }
      shown.forEach(({ x, at, label, number, injected }) => {
        pen.setLineDash([2, 3]);
        stroke(pen, [[x, box.top], [at, box.top - 10]], style("event"));
        pen.setLineDash([]);
        pen.save();
        pen.translate(at, box.top - 12);
        pen.rotate(-SLANT);
        pen.fillStyle = style(injected ? "bad" : "text");
        text(pen, number + " " + label, 0, 0, "left", "middle", WIDEST);
        pen.restore();
      });
    }
    read(seen) {
      const last = seen && data.events.filter(([time]) => time <= cursor).at(-1);
      const stop = seen && data.stops.find(([from, to]) => from <= cursor && cursor < to);
      this.output.textContent = seen ? [cursor.toFixed(2) + " s", last && "after: " + last[1], stop && stop[2]].filter(Boolean).join(" · ") : "";
    }
  }

  // ---- the base in the plane, and the mechanisms -----------------------------------------------
  // The sample at the cursor, else the last one in view.
  const newest = ({ from, step }, count) => clamp(Math.round(((cursor ?? view[1]) - from) / step), 0, count - 1);

  class Path {
    constructor(canvas) {
      this.canvas = canvas;
      const legend = canvas.closest("figure").querySelector(".legend");
      const item = (name, paint) => {
        const span = element("span", legend);
        element("i", span).style.background = `var(--${paint})`;
        span.append(name);
      };
      if (data.path.x.some((metres) => metres != null)) item("the base", "line-0");
      data.path.lines.forEach(({ name, paint }) => item(name + " (dashed)", paint));
      this.output = element("output", element("span", legend, "whole"));
    }
    draw() {
      const { pen, width, height } = open(this.canvas), { from, step, x: xs, y: ys, yaw, steered, lines } = data.path;
      const extent = (axis) => data.path[axis].concat(...lines.map((line) => line[axis]))
        .reduce(([low, high], value) => [Math.min(low, value ?? 0), Math.max(high, value ?? 0)], [0, 0]);
      const ends = ["x", "y"].map(extent), spans = ends.map(([low, high]) => high - low);
      // The whole body has room.
      const body = Math.max(...data.drawn.wheels.map(([x, y, , radius]) => Math.hypot(x, y) + radius)), air = Math.max(0.24 * Math.max(...spans), 2 * body);
      const box = { left: 40, top: 18, right: width - 8, bottom: height - 36 };
      const floor = Field.floor(box, ends.map(([low, high]) => (low + high) / 2), spans.map((span) => span + air));
      const place = (x, y) => (x == null || y == null ? null : floor.to([x, y]));
      this.spot = (index) => place(xs[index], ys[index]);
      Field.grid(pen, floor);
      pen.fillStyle = style("muted");
      text(pen, "x (forward) / m", box.right, box.bottom + 20, "right", "top");
      text(pen, "y (left) / m", 2, box.top - 4, "left", "bottom");
      const first = Math.max(0, Math.floor((view[0] - from) / step)), last = Math.ceil((view[1] - from) / step);
      this.trace(pen, 0, xs.length - 1, "rule");
      this.trace(pen, first, Math.min(last, xs.length - 1), "line-0");
      pen.setLineDash([5, 4]);
      lines.forEach((line) => {
        const spots = line.x.map((x, index) => place(x, line.y[index])).slice(first, last + 1);
        stroke(pen, spots.filter((spot) => spot), style(line.paint), 1.5);
      });
      pen.setLineDash([]);
      const every = Math.max(1, Math.round(0.5 / step));
      for (let index = 0; index < xs.length; index += every) {
        const spot = this.spot(index);
        if (spot && yaw[index] != null && index >= first && index <= last) this.arrow(pen, spot, yaw[index]);
      }
      this.mark(pen, 0, "start", "good", "bottom");
      this.mark(pen, xs.length - 1, "end", "bad", "top");
      const now = newest(data.path, xs.length), heading = yaw[now] == null ? null : yaw[now] * 180 / Math.PI;
      // Where it is, else where it counts.
      const pose = [data.path, ...lines].map((it) => [it.x[now], it.y[now], it.yaw[now]]).find((it) => it.every((one) => one != null));
      if (pose) inside(pen, box, () => Field.base(pen, floor, pose, data.drawn.wheels, (steered[now] || []).map((degrees) => [degrees * Math.PI / 180]), "line-0"));
      this.output.textContent = cursor === null || !this.spot(now) ? ""
        : `x ${show(xs[now], 2)} m   y ${show(ys[now], 2)} m   heading ${show(heading, 0)}°`;
    }
    trace(pen, first, last, paint) {
      let points = [];
      for (let index = first; index <= last + 1; index++) {
        const spot = index <= last && this.spot(index);
        if (spot) points.push(spot);
        else if (points.length) {
          stroke(pen, points, style(paint), 2);
          points = [];
        }
      }
    }
    arrow(pen, [x, y], yaw) {
      pen.save();
      pen.translate(x, y);
      pen.rotate(-yaw);
      pen.fillStyle = style("line-0");
      pen.strokeStyle = style("card");
      pen.beginPath();
      [[9, 0], [-5, 5], [-2, 0], [-5, -5]].forEach((corner) => pen.lineTo(...corner));
      pen.closePath();
      pen.stroke();
      pen.fill();
      pen.restore();
    }
    mark(pen, index, words, paint, side) {
      const spot = this.spot(index);
      if (!spot) return;
      pen.fillStyle = style(paint);
      pen.beginPath();
      pen.arc(...spot, 4, 0, 2 * Math.PI);
      pen.fill();
      pen.font = "bold " + FONT;
      text(pen, words, spot[0], spot[1] + (side === "top" ? 10 : -10), "center", side);
      pen.font = FONT;
    }
    point() {
      this.draw();
    }
  }

  class Mechanisms {
    constructor(canvas) {
      this.canvas = canvas;
    }
    draw() {
      const angles = Object.entries(data.turned).map(([motor, all]) => [motor, all[newest(data.path, all.length)]]);
      Field.mechanisms(this.canvas, data.drawn.mechanisms, Object.fromEntries(angles));
    }
    point() {
      this.draw();
    }
  }

  // ---- all together ----------------------------------------------------------------------------
  const plots = Array.from(document.querySelectorAll("canvas"), (canvas) => {
    const which = canvas.dataset.plot;
    if (which === "timeline") return new Timeline(canvas);
    if (which === "mechanisms") return new Mechanisms(canvas);
    return which === "path" ? new Path(canvas) : new Chart(canvas, data.charts[Number(which)]);
  });
  const reset = document.getElementById("reset");
  const draw = () => {
    restyle();
    plots.forEach((plot) => plot.draw());
  };
  function point(time) {
    cursor = time;
    plots.forEach((plot) => plot.point());
  }
  function zoom([from, to]) {
    const [first, last] = whole, span = Math.max(to - from, 2 * data.period);
    const begin = clamp(from, first, Math.max(first, last - span));
    view = span >= last - first ? whole : [begin, begin + span];
    reset.hidden = view === whole;
    draw();
  }
  const folds = document.querySelectorAll(".verdict details");
  const print = (on) => {
    document.documentElement.classList.toggle("print", on);
    folds.forEach((fold) => {
      if (on) fold.dataset.open = fold.open;
      fold.open = on || fold.dataset.open === "true";
    });
    point(null);
    draw();
  };
  // From a finding to its time, with some of what was before and after it.
  document.querySelectorAll("a[data-zoom]").forEach((link) => link.addEventListener("click", () => {
    const [from, to] = link.dataset.zoom.split(" ").map(Number);
    zoom([from - 0.4, to + 0.4]);
    point(from);
  }));
  reset.addEventListener("click", () => zoom(whole));
  window.addEventListener("resize", draw);
  window.addEventListener("beforeprint", () => print(true));
  window.addEventListener("afterprint", () => print(false));
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);
  draw();
})();
