// Plots of the chosen signals.
let newest = 0;         // the robot's time of what is drawn, µs
async function fetchData() {
  const begin = performance.now(), to = end !== null ? end : newest;
  from = Math.max(0, Math.round(to - span * 1e6));
  const signals = [...chosen], columns = Math.max(100, $('plots').clientWidth - 80);
  try {
    const answer = await fetch('data?signals=' + signals.join(',') + '&from=' + from + '&to=' + Math.round(to) + '&columns=' + columns + (state.fast < +$('period').value && state.fast ? '&every=' + $('period').value : ''));
    if (!answer.ok) throw new Error();
    const view = new DataView(await answer.arrayBuffer());
    newest = view.getFloat64(0, true); data = series(signals, view);
    draw();
  } catch { /* The next one is a new chance. */ }
  // 33 times a second, with some time between for all else.
  setTimeout(fetchData, Math.max(5, 30 - (performance.now() - begin)));
}

// The server's answer: signal -> { times, values }.
function series(signals, view) {
  let at = 8; const news = new Map();
  for (const signal of signals) {
    const count = view.getUint32(at, true); at += 4;
    const times = new Float32Array(count), values = new Float32Array(count);
    for (let i = 0; i < count; i += 1, at += 8) { times[i] = view.getFloat32(at, true); values[i] = view.getFloat32(at + 4, true); }
    news.set(signal, { times, values });
  }
  return news;
}

// One plot for each unit, one lane for each state.
function draw() {
  const plots = new Map();
  for (const it of state.signals) if (chosen.has(it.index)) {
    const of = it.states.length ? 'states' : it.unit || 'number';
    if (!plots.has(of)) plots.set(of, []);
    plots.get(of).push(it);
  }
  const have = new Map([...$('plots').children].map((it) => [it.dataset.unit, it]));
  for (const [unit, signals] of plots) {
    let plot = have.get(unit);
    if (!plot) {
      plot = $('plots').appendChild(document.createElement('div'));
      plot.className = 'plot'; plot.dataset.unit = unit;
      plot.append(document.createElement('div'), document.createElement('canvas'));
      plot.firstChild.className = 'legend';
      for (const [text, title, make] of [['PNG', 'Save this plot as a picture', savePicture], ['CSV', 'Save the values of this plot', saveNumbers]]) {
        const button = document.createElement('button'); button.textContent = text; button.title = title; button.className = 'save'; button.onclick = () => make(plot);
        plot.insertBefore(button, plot.firstChild.nextSibling);
      }
      listen(plot.lastChild);
    }
    have.delete(unit);
    unit === 'states' ? lanes(plot, signals) : lines(plot, unit, signals);
  }
  for (const plot of have.values()) plot.remove();
}

const LEFT = 56, WIDE = 130, RIGHT = 8;
// A canvas of this height, and the box of its plot.
function sheet(plot, left, height) {
  const canvas = plot.lastChild;
  canvas.style.height = height + 'px';
  const { pen, width } = Plot.open(canvas);
  return [pen, { left, top: 6, right: width - RIGHT, bottom: height - 20 }];
}
const view = () => [from * 1e-6, from * 1e-6 + span];
const at = (series, seconds) => {
  if (!series || !series.times.length) return NaN;
  let low = 0, high = series.times.length - 1;
  while (low < high) { const middle = (low + high + 1) >> 1; if (series.times[middle] <= seconds) low = middle; else high = middle - 1; }
  return series.values[low];
};
function legend(plot, title, entries) {
  plot.firstChild.replaceChildren(Object.assign(document.createElement('span'), { textContent: title, className: 'unit' }), ...entries.map(([colour, name, text]) => {
    const line = document.createElement('span'), i = document.createElement('i'), b = document.createElement('b');
    i.style.background = colour; b.textContent = text; line.append(i, name + ' ', b); return line;
  }));
}

function lines(plot, unit, signals) {
  const [pen, box] = sheet(plot, LEFT, 190);
  let low = Infinity, high = -Infinity;
  for (const it of signals) for (const value of (data.get(it.index) || { values: [] }).values) if (Number.isFinite(value)) { low = Math.min(low, value); high = Math.max(high, value); }
  if (low > high) { low = -1; high = 1; }
  const margin = (high - low) * 0.06 || Math.abs(high) * 0.1 || 1; low -= margin; high += margin;
  const x = Plot.across(box, [0, span]), y = Plot.up(box, [low, high]);
  Plot.valueAxis(pen, box, [low, high], '');
  Plot.timeAxis(pen, box, view(), false);
  Plot.inside(pen, box, () => signals.forEach((it, place) => {
    const series = data.get(it.index); if (!series) return;
    const point = (i) => Number.isFinite(series.values[i]) ? [x(series.times[i]), y(series.values[i])] : null;
    Plot.trace(pen, [0, series.times.length - 1], point, { paint: Plot.colour(place), width: 1.5, dash: it.name === 'target' ? [5, 4] : [] });
  }));
  moments(pen, box, x, signals);
  cross(pen, box, x);
  legend(plot, unit, signals.map((it, place) => [Plot.colour(place), (it.label + ' ' + it.name).trim(), number(at(data.get(it.index), cursor === null ? Infinity : cursor))]));
}

function lanes(plot, signals) {
  const each = 16, [pen, box] = sheet(plot, WIDE, signals.length * each + 28), x = Plot.across(box, [0, span]);
  signals.forEach((it, place) => {
    const series = data.get(it.index) || { times: [], values: [] }, runs = [];
    for (let i = 0; i < series.times.length; i += 1) {
      const value = series.values[i]; if (!Number.isFinite(value)) continue;
      let last = i; while (last + 1 < series.times.length && series.values[last + 1] === value) last += 1;
      const to = last + 1 < series.times.length ? series.times[last + 1] : series.times[last];
      runs.push({ from: series.times[i], to, paint: Plot.state(it.states[value], value), words: it.states[value] || String(value) });
      i = last;
    }
    Plot.lane(pen, box, x, [box.top + place * each, each - 3], (it.label + ' ' + it.name).trim(), runs);
  });
  Plot.timeAxis(pen, box, view(), false);
  moments(pen, box, x, signals);
  cross(pen, box, x);
  legend(plot, 'states', cursor === null ? [] : signals.map((it) => ['transparent', (it.label + ' ' + it.name).trim(), it.states[at(data.get(it.index), cursor)] || '–']));
}

// What happened in the window; where one was led to; and where no data are.
function moments(pen, box, x, signals) {
  const begin = beginOf(signals.map((it) => it.index)) * 1e-6 - from * 1e-6;
  if (begin > 0) Plot.hatch(pen, { ...box, right: Math.min(box.right, x(begin)) });
  let last = -Infinity;
  for (const [at, what, paint] of marks(view())) { const to = x(at - from * 1e-6); Plot.moment(pen, box, to, to - last > 90 ? what : '', paint); last = to - last > 90 ? to : last; }
  if (lead !== null) Plot.stroke(pen, [[x(lead - from * 1e-6), box.top], [x(lead - from * 1e-6), box.bottom]], Plot.style('bad'), 2);
}

function cross(pen, box, x) { if (cursor !== null) Plot.stroke(pen, [[x(cursor), box.top], [x(cursor), box.bottom]], Plot.style('text')); }

function listen(it) {
  const left = () => it.parentNode.dataset.unit === 'states' ? WIDE : LEFT, seconds = (event) => (event.offsetX - left()) / (it.clientWidth - left() - RIGHT) * span;
  it.onmousemove = (event) => {
    const now = seconds(event);
    if (event.buttons & 1) { hold(); end -= event.movementX / (it.clientWidth - left() - RIGHT) * span * 1e6; } else cursor = now >= 0 && now <= span ? now : null;
    draw();
  };
  it.onmouseleave = () => { cursor = null; draw(); };
  it.onwheel = (event) => {
    event.preventDefault();
    const factor = event.deltaY > 0 ? 1.25 : 0.8, place = Math.min(1, Math.max(0, seconds(event) / span)), before = span;
    span = Math.min(1800, Math.max(0.02, span * factor));
    if (end !== null) end += (span - before) * (1 - place) * 1e6;
  };
  it.ondblclick = go;
}
const hold = () => { if (end === null) { end = state.now; } $('pause').textContent = 'Newest'; };
const go = () => { lead = null; if (state.file) { seek(state.now); return; } end = null; $('pause').textContent = 'Pause'; };
$('pause').onclick = () => end === null ? hold() : go();
