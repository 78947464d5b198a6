// Answers to steps of a target: found in samples, with their figures, and drawn.
const Step = (() => {
  const CONSTANT = 0.1, LEAST = 0.25, MOST = 2, BAND = 0.05;
  // Figures of what follows a jump `from` one value `to` another, at `times` s after it: rise time from 10 to 90 % of its own
  // way, overshoot in % of that, time after which it stays within 5 % of where it ends; and what is left to the target.
  function figures(times, values, from, to) {
    const end = times[times.length - 1], tail = [];
    for (let i = 0; i < times.length; i += 1) if (times[i] >= 0.8 * end) tail.push(values[i]);
    const last = tail.reduce((sum, it) => sum + it, 0) / tail.length, way = last - from;
    const share = (i) => (values[i] - from) / way;
    const reaches = (level) => {
      for (let i = 1; i < times.length; i += 1) if (share(i) >= level && share(i - 1) < level) return times[i - 1] + (level - share(i - 1)) / (share(i) - share(i - 1)) * (times[i] - times[i - 1]);
      return NaN;
    };
    let peak = 0, settling = 0;
    for (let i = 0; i < times.length; i += 1) {
      peak = Math.max(peak, share(i));
      if (Math.abs(share(i) - 1) > BAND) settling = i + 1 < times.length ? times[i + 1] : NaN;
    }
    // What leaves the band near the end may leave it again.
    if (settling > 0.9 * end) settling = NaN;
    return { rise: reaches(0.9) - reaches(0.1), overshoot: Math.max(0, peak - 1) * 100, settling, error: to - last };
  }
  // Steps in a target that stands still before and after them, while the motor runs: when each began, and what followed it.
  function find(target, measured, runs) {
    const { times } = target, asked = target.values.map((it, i) => runs(times[i]) ? it : NaN);
    const known = asked.filter(Number.isFinite), size = Math.max(...known) - Math.min(...known, ...(asked.some(Number.isNaN) ? [0] : [])), steps = [];
    for (let i = 1; i < asked.length; i += 1) {
      const to = asked[i], before = asked[i - 1];
      if (!Number.isFinite(to) || before === to) continue;
      let last = i, first = i - 1;
      while (last + 1 < asked.length && asked[last + 1] === to && times[last + 1] - times[i] <= MOST) last += 1;
      while (first > 0 && Object.is(asked[first - 1], before) && times[i] - times[first] < CONSTANT) first -= 1;
      const at = times[i];
      if (times[last] - at < LEAST || times[i - 1] - times[first] < 0.5 * CONSTANT) continue;
      const within = (low, high) => [...measured.times.keys()].filter((k) => measured.times[k] >= low && measured.times[k] <= high && Number.isFinite(measured.values[k]));
      const rest = within(at - CONSTANT, at - 1e-4), after = within(at, times[last]);
      if (!rest.length || after.length < 20) continue;
      const from = rest.reduce((sum, k) => sum + measured.values[k], 0) / rest.length;
      // What still moves, as after a turn that was interrupted, is not at rest.
      const calm = Math.max(...rest.map((k) => Math.abs(measured.values[k] - from))) <= 0.1 * Math.abs(to - from);
      if (!calm || !(size > 0) || Math.abs(to - from) < 0.2 * size) continue;
      const seconds = after.map((k) => measured.times[k] - at), values = after.map((k) => measured.values[k]);
      steps.push({ at, from, to, times: seconds, values, ...figures(seconds, values, from, to) });
    }
    return steps;
  }
  // Steps over one another, as shares of their way, and a table of their figures.
  function draw(canvas, rows, overlay) {
    canvas.hidden = !overlay.length; rows.replaceChildren();
    if (!overlay.length) return;
    const head = rows.insertRow(), cell = (row, text, kind = '') => { const it = row.insertCell(); it.textContent = text; it.className = kind; return it; };
    for (const text of ['step', 'gains', 'rise', 'overshoot', 'settling', 'steady error']) { const th = document.createElement('th'); th.textContent = text; head.append(th); }
    const ms = (seconds) => Number.isNaN(seconds) ? '–' : (seconds * 1000).toFixed(0) + ' ms', brief = (value) => String(+value.toFixed(1));
    overlay.forEach((it, place) => {
      const row = rows.insertRow(), first = cell(row, it.label + ' ' + brief(it.from) + ' → ' + brief(it.to) + ' ' + it.unit), sign = document.createElement('i');
      sign.style.background = Plot.colour(place); first.prepend(sign);
      cell(row, it.gains, 'gains'); cell(row, ms(it.rise)); cell(row, it.overshoot.toFixed(0) + ' %'); cell(row, Number.isNaN(it.settling) ? 'not settled' : ms(it.settling)); cell(row, it.error.toPrecision(2) + ' ' + it.unit);
    });
    const { pen, width, height } = Plot.open(canvas), box = { left: 40, top: 8, right: width - 8, bottom: height - 20 };
    const longest = Math.max(...overlay.map((it) => it.times[it.times.length - 1])), share = (it, k) => (it.values[k] - it.from) / (it.to - it.from);
    const highest = Math.min(3, Math.max(1.2, ...overlay.flatMap((it) => it.values.map((_, k) => share(it, k) * 1.05))));
    const x = Plot.across(box, [0, longest]), y = Plot.up(box, [-0.1, highest]);
    Plot.valueAxis(pen, box, [-0.1, highest], '');
    Plot.timeAxis(pen, box, [0, longest], false);
    Plot.stroke(pen, [[box.left, y(1)], [box.right, y(1)]], Plot.style('muted'));
    Plot.inside(pen, box, () => overlay.forEach((it, place) => Plot.trace(pen, [0, it.times.length - 1], (k) => [x(it.times[k]), y(share(it, k))], { paint: Plot.colour(place), width: 1.5 })));
  }
  return { figures, find, draw };
})();
