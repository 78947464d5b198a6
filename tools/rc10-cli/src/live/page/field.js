// The field from above, and the mechanisms.
const View = (() => {
  const PATHS = [['true', 'true path', 'line-0'], ['wheels', 'by its wheels', 'muted'], ['odometry', 'by its odometry', 'line-4'], ['reference', 'its reference', 'line-2']];
  const SPAN = 20, MOST = 4000;   // seconds of the trail; points that are kept
  let trails = {}, last = 0, offset = null, error = 0, whole = false, parts = null;

  function clear() { trails = {}; offset = null; error = 0; }
  function take() {
    const field = moving.field;
    if (!field || moving.now === last) return;
    if (moving.now < last) clear();
    last = moving.now;
    for (const [name] of PATHS) if (field[name]) {
      const trail = trails[name] = trails[name] || [];
      trail.push([moving.now, ...field[name]]);
      if (trail.length > MOST) trails[name] = trail.filter((_, at) => at % 2 || at > MOST / 2);
    }
  }
  const best = (field) => field.true || field.odometry || field.wheels;
  function build() {
    const place = $('field'), make = (tag, text) => { const it = document.createElement(tag); if (text) it.textContent = text; return it; };
    const head = make('h2', 'Field '), label = make('label'), box = make('input'), canvas = make('canvas'), shapes = make('canvas'), legend = make('p'), off = make('p');
    label.className = 'unit'; box.type = 'checkbox'; box.onchange = () => { whole = box.checked; }; box.onkeydown = (event) => { if (event.key === 'Enter') box.click(); };
    const { wheels, mechanisms } = state.drawn;
    label.append(box, make('span', 'the whole path')); if (wheels.length) head.append(label);
    canvas.setAttribute('role', 'img'); canvas.setAttribute('aria-label', 'The base from above');
    shapes.setAttribute('role', 'img'); shapes.setAttribute('aria-label', 'Mechanisms'); shapes.className = 'mechanisms';
    legend.className = 'legend'; off.className = 'hint';
    const entry = (name, paint) => { const it = legend.appendChild(make('span')); const line = it.appendChild(make('i')); line.style.background = 'var(--' + paint + ')'; it.append(make('span', name)); return it; };
    const entries = new Map(PATHS.map(([name, text, paint]) => [name, entry(text, paint)]));
    for (const [text, paint] of [['wheels: commanded', 'line-1'], ['measured', 'line-0'], ['slip', 'bad'], ['heading by the IMU', 'line-3']]) entry(text, paint);
    place.replaceChildren(head, ...(wheels.length ? [canvas, legend, off] : []), ...(mechanisms.length ? [shapes] : []));
    parts = { canvas, shapes, entries, off };
  }
  function draw() {
    requestAnimationFrame(draw);
    const field = moving.field, fixed = state.drawn;
    $('field').hidden = !field || !fixed || !(fixed.wheels.length || fixed.mechanisms.length);
    if ($('field').hidden || $('tab-robot').hidden || document.hidden) return;
    if (!parts) build();
    take();
    if (fixed.mechanisms.length) Field.mechanisms(parts.shapes, fixed.mechanisms, field.angles || {});
    const pose = best(field);
    if (!pose || !fixed.wheels.length) return;
    const { pen, width, height } = Plot.open(parts.canvas), box = { left: 40, top: 6, right: width - 6, bottom: height - 22 };
    let middle = pose, metres = [4, 4];
    if (whole) {
      const all = Object.values(trails).flat(), ends = [1, 2].map((at) => all.reduce(([low, high], it) => [Math.min(low, it[at]), Math.max(high, it[at])], [Infinity, -Infinity]));
      middle = ends.map(([low, high]) => (low + high) / 2); metres = ends.map(([low, high]) => Math.max(2, high - low + 1));
    }
    const floor = Field.floor(box, middle, metres);
    Field.grid(pen, floor);
    Plot.inside(pen, box, () => {
      const from = whole ? -Infinity : last - SPAN;
      for (const [name, , paint] of PATHS) {
        const points = (trails[name] || []).filter(([at]) => at >= from).map(([, ...at]) => floor.to(at));
        parts.entries.get(name).hidden = !points.length;
        pen.setLineDash(name === 'true' ? [] : [5, 4]);
        Plot.stroke(pen, points, Plot.style(paint), 2);
        pen.setLineDash([]);
      }
      const ghost = field.true && (field.odometry || field.wheels);
      if (ghost) Field.base(pen, floor, ghost, fixed.wheels, null, field.odometry ? 'line-4' : 'muted');
      Field.base(pen, floor, pose, fixed.wheels, field.rims || [], 'line-0');
      if (field.heading !== null && field.heading !== undefined) {
        // A heading that jumps was set to zero, as at arming: it begins anew at the base's.
        if (offset === null || Math.abs(pose[2] - field.heading - offset - error) > 0.2) offset = pose[2] - field.heading;
        error = pose[2] - field.heading - offset;
        Field.arrow(pen, floor.to(pose), floor.to(Field.turned([pose[0], pose[1], field.heading + offset], [0.5, 0])), Plot.style('line-3'), 2);
      }
    });
    const off = apart();
    parts.off.textContent = off === null ? '' : 'What it counts is ' + off.toFixed(2) + ' m from where it is.';
    parts.scale = floor.scale;
  }
  // From the true place to the one that the robot counts, m, at the end of what is drawn.
  function apart() {
    const [real, counted] = [trails.true, trails.odometry || trails.wheels].map((it) => it && it[it.length - 1]);
    return real && counted ? Math.hypot(real[1] - counted[1], real[2] - counted[2]) : null;
  }
  return { draw, apart, trails: () => trails, scale: () => parts && parts.scale };
})();
