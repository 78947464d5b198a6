const $ = (id) => document.getElementById(id);
let state = { signals: [], parameters: [], losses: {} };
let chosen = new Set();
let span = 10;          // seconds in the window
let end = null;         // its end, µs; null: the newest
let data = new Map();   // signal -> { times, values }, seconds from `from`
let from = 0;
let cursor = null;      // seconds from `from`
let undo = [];
let begun = false;
let declaration = null; // of the robot that the page was made for

// A browser opens six connections: some stay free for STOP, whatever the robot does not answer.
let flying = 0;
const post = async (wish, urgent) => {
  if (flying >= 3 && !urgent) throw new Error('the robot has not answered what was asked before');
  flying += 1;
  try {
    const response = await fetch('/wish', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(wish) });
    const answer = await response.json();
    if (answer.refused !== undefined) throw new Error(answer.refused);
    return answer.ok;
  } finally { flying -= 1; }
};
const say = (id, text) => { $(id).textContent = text || ''; $(id).hidden = !text; };
const attempt = (wish) => post(wish).then((it) => { say('refused', ''); return it; }, (error) => { say('refused', String(error.message || error)); throw error; });
const number = (value) => value === null || value === undefined || Number.isNaN(value) ? '–'
  : Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(2) : String(+value.toFixed(3));
const cell = (row, text, kind) => { const it = row.insertCell(); it.textContent = text; if (kind) it.className = kind; return it; };
const value = (label, name) => { const it = state.signals.find((it) => it.label === label && it.name === name); return it ? it.value : null; };
const named = (label, name) => { const it = state.signals.find((it) => it.label === label && it.name === name); return it && it.value !== null ? it.states[it.value] || '?' : '–'; };
const labels = (folder) => [...new Set(state.signals.filter((it) => it.folder === folder).map((it) => it.label))];
const keep = () => { try { localStorage.setItem('rc10', JSON.stringify({ chosen: [...chosen].map(key), span })); } catch { /* private window */ } };
const key = (index) => { const it = state.signals.find((it) => it.index === index); return it ? it.folder + '/' + it.label + '/' + it.name : ''; };

// The first look: what is remembered of the last time, or the first motor. Another robot has other numbers.
function begin() {
  begun = true;
  declaration = state.declaration; chosen = new Set(); data = new Map(); undo = [];
  let known = {};
  try { known = JSON.parse(localStorage.getItem('rc10')) || {}; } catch { /* private window */ }
  const wanted = new Set(known.chosen || []);
  if (known.span) { span = known.span; $('window').value = String(span); }
  for (const it of state.signals) if (wanted.has(key(it.index))) chosen.add(it.index);
  const [motor] = labels('motors');
  if (!chosen.size) for (const it of state.signals) {
    const first = it.label === motor && ['target', 'measured', 'current'].includes(it.name);
    if (first || (it.folder === 'motors' && it.name === 'drive') || it.name === 'arm') chosen.add(it.index);
  }
  tree(); watch();
}

function tree() {
  const wanted = $('search').value.toLowerCase().split(/\s+/).filter(Boolean);
  const open = new Set([...document.querySelectorAll('#tree details[open]')].map((it) => it.dataset.label));
  const groups = new Map();
  for (const it of state.signals) {
    const label = it.label ? (it.folder === 'motors' || it.folder === 'signals' ? it.label : it.folder.replace(/e?s$/, '') + ' ' + it.label) : it.folder;
    const text = (label + ' ' + it.name).toLowerCase();
    if (!wanted.every((word) => text.includes(word))) continue;
    if (!groups.has(label)) groups.set(label, []);
    groups.get(label).push(it);
  }
  $('tree').replaceChildren(...[...groups].map(([label, all]) => {
    const details = document.createElement('details');
    details.dataset.label = label;
    details.open = wanted.length > 0 || open.has(label);
    const summary = details.appendChild(document.createElement('summary'));
    summary.textContent = label;
    for (const it of all) {
      const line = details.appendChild(document.createElement('label'));
      const box = line.appendChild(document.createElement('input'));
      box.type = 'checkbox'; box.checked = chosen.has(it.index); box.dataset.signal = it.index;
      // The answer to a question has at most this many.
      box.onchange = () => { if (chosen.size >= 64) box.checked = false; box.checked ? chosen.add(it.index) : chosen.delete(it.index); watch(); keep(); };
      // Space stops the robot.
      box.onkeydown = (event) => { if (event.key === 'Enter') box.click(); };
      line.append(' ' + it.name + (it.unit ? ', ' + it.unit : ''));
    }
    return details;
  }));
}

const watch = () => post({ watch: [...chosen], period: +$('period').value }).catch(() => {});

function buttons(place, motor) {
  const add = (text, title) => { const button = place.appendChild(document.createElement('button')); button.textContent = text; button.title = title; button.setAttribute('aria-label', motor + ': ' + title); button.style.padding = '0 5px'; return button; };
  for (const [text, action, title] of [['0', 'zero', 'The angle now is zero; only while the robot is disarmed'], ['✓', 'clear', 'Clear the fault']])
    add(text, title).onclick = () => attempt({ do: action, motor }).catch(() => {});
  for (const [text, way] of [['−', -1], ['+', 1]]) {
    const button = add(text, 'Turns slowly while it is held, if the robot is disarmed and its table allows it');
    button.onpointerdown = (event) => { button.setPointerCapture(event.pointerId); jog(motor, way * $('jog').value); };
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) button.addEventListener(end, () => jog(motor, 0));
    button.oncontextmenu = (event) => event.preventDefault();
  }
}

// The robot turns the motor for 80 ms: it is told again and again while the button is held.
let held = null;
async function jog(motor, speed) {
  const mine = speed ? {} : null;
  if (!speed && held === null) return;
  held = mine;
  do {
    try { await attempt({ do: 'jog', motor, speed }); } catch { if (held === mine) held = null; return; }
    if (mine) await new Promise((go) => setTimeout(go, 25));
  } while (mine && held === mine);
  if (mine) await post({ do: 'jog', motor, speed: 0 }).catch(() => {});
}
window.addEventListener('blur', () => { held = null; });

function tables() {
  // Rows stay, because a button may be held.
  const motors = $('motors');
  let row;
  if (!motors.rows.length) {
    row = motors.insertRow();
    for (const head of ['motor', 'link', 'drive', 'target', 'measured', 'A', '°C', '']) { const th = document.createElement('th'); th.textContent = head; row.append(th); }
  }
  const have = new Map([...motors.rows].slice(1).map((row) => [row.dataset.motor, row]));
  labels('motors').forEach((label) => {
    row = have.get(label); have.delete(label);
    if (!row) {
      row = motors.insertRow(); row.dataset.motor = label;
      for (let count = 0; count < 8; count += 1) cell(row, '');
      row.cells[0].textContent = label;
      buttons(row.cells[7], label);
    }
    const link = named(label, 'link');
    row.cells[1].textContent = link; row.cells[1].className = link === 'Online' ? '' : 'bad';
    row.cells[2].textContent = named(label, 'drive');
    ['target', 'measured', 'current', 'temperature'].forEach((name, at) => { row.cells[3 + at].textContent = number(value(label, name)); });
  });
  for (const row of have.values()) row.remove();
  const buses = $('buses'); buses.replaceChildren();
  row = buses.insertRow();
  for (const head of ['bus', 'state', 'planned %', 'received', 'missed', 'lost', 'tick, µs']) { const th = document.createElement('th'); th.textContent = head; row.append(th); }
  for (const label of labels('buses')) {
    row = buses.insertRow();
    cell(row, label);
    const errors = named(label, 'state'); cell(row, errors, errors === 'Active' ? '' : 'bad');
    for (const name of ['planned_typical', 'received', 'overruns', 'receive_lost', 'execution_max']) cell(row, number(value(label, name)));
  }
  const list = [state.trouble, state.stranger].filter(Boolean).map((text) => ({ text, severity: 'problem' })).concat(state.problems || []);
  const bad = list.filter((it) => it.severity === 'problem'), known = list.filter((it) => it.severity !== 'problem');
  const items = (all) => all.map((it) => { const li = document.createElement('li'); li.className = it.severity; li.textContent = (it.about ? it.about + ': ' : '') + it.text; return li; });
  $('problems').replaceChildren(...items(bad.length ? bad : [{ text: 'none', severity: 'none' }]));
  $('known').replaceChildren(...items(known));
  const lately = (state.happened || []).slice(-8).reverse();
  $('happened').replaceChildren(...lately.map(([at, what]) => { const li = document.createElement('li'); li.textContent = at.toFixed(2) + ' s  ' + what; return li; }));
  $('happened').previousElementSibling.hidden = !lately.length;
  $('known').parentNode.hidden = !known.length; $('count').textContent = known.length;
}

// Rows stay where they are, so that one may type while values change.
function parameters() {
  const table = $('parameters'), wanted = $('find').value.toLowerCase();
  const rows = new Map([...table.rows].map((row) => [row.dataset.parameter, row]));
  for (const it of state.parameters) {
    let row = rows.get(it.full);
    if (!row) {
      row = table.insertRow(); row.dataset.parameter = it.full;
      cell(row, it.label + (it.name === 'value' ? '' : ' ' + it.name));
      const input = cell(row, '').appendChild(document.createElement('input'));
      input.setAttribute('aria-label', it.full);
      input.onkeydown = (event) => { if (event.key === 'Enter') input.blur(); if (event.key === 'Escape') { input.value = input.dataset.value; input.blur(); } };
      input.onchange = () => change(it.full, input);
      cell(row, it.unit, 'unit');
    }
    rows.delete(it.full);
    row.hidden = !it.full.toLowerCase().includes(wanted);
    row.className = it.value !== it.initial ? 'changed' : '';
    row.title = it.range[0] + ' to ' + it.range[1] + ', ' + it.initial + ' at power-on';
    const input = row.cells[1].firstChild;
    input.dataset.value = String(+it.value.toPrecision(7));
    if (document.activeElement !== input) input.value = input.dataset.value;
  }
  for (const row of rows.values()) row.remove();
}

async function change(full, input) {
  const it = state.parameters.find((it) => it.full === full), wanted = Number(input.value);
  if (!it || input.value.trim() === '' || Number.isNaN(wanted)) { say('refused', '“' + input.value + '” is no number'); input.value = input.dataset.value; return; }
  // A loop that would shake is said so before it does; the same value once more is meant.
  const advice = input.dataset.meant === input.value ? null : await post({ advise: [full, wanted] }).catch(() => null);
  if (advice) { say('refused', full + ' = ' + input.value + ': ' + advice + '. Enter it once more to set it all the same.'); input.dataset.meant = input.value; input.value = input.dataset.value; return; }
  delete input.dataset.meant;
  try {
    await attempt({ set: [[full, wanted]] });
    undo.push([it.full, it.value]); $('undo').disabled = false;
  } catch { input.value = input.dataset.value; }
}
$('undo').onclick = async () => {
  const last = undo.pop(); $('undo').disabled = !undo.length;
  const it = last && state.parameters.find((it) => it.full === last[0]);
  if (it) await attempt({ set: [[it.full, last[1]]] }).catch(() => {});
};

async function refresh() {
  try {
    state = await (await fetch('/state')).json() || state;
    $('trouble').textContent = state.trouble || '';
    document.body.classList.remove('ended');
  } catch { $('trouble').textContent = 'rc10 live has ended'; document.body.classList.add('ended'); setTimeout(refresh, 1000); return; }
  $('name').textContent = state.name;
  say('note', state.note);
  const arm = named('', 'arm');
  $('arm').textContent = arm; $('arm').className = 'pill ' + arm;
  const stick = named('', 'not_at_rest');
  say('rest', stick === '–' || stick === 'all' ? '' : 'Not armed: ' + stick + ' is not at rest. Put it there and arm again.');
  show();
  $('record').textContent = state.record ? '■ ' + state.record.seconds.toFixed(0) + ' s' : '● Record';
  $('record').className = state.record ? 'on' : '';
  const losses = [['samples', 'samples lost on the way'], ['skipped', 'samples the line was too slow for'], ['damaged', 'damaged frames'], ['unknown', 'messages not understood'], ['left', 'signals without room']];
  $('losses').textContent = losses.filter(([name]) => state.losses[name] > 0).map(([name, what]) => state.losses[name] + ' ' + what).join(' · ');
  if (state.whole && (!begun || state.declaration !== declaration)) begin();
  tables(); parameters();
  setTimeout(refresh, 200);
}

async function fetchData() {
  const paused = end !== null, to = paused ? end : state.now || 0;
  from = Math.max(0, Math.round(to - span * 1e6));
  const signals = [...chosen], columns = Math.max(100, $('plots').clientWidth - 80);
  try {
    const answer = await fetch('/data?signals=' + signals.join(',') + '&from=' + from + '&to=' + Math.round(to) + '&columns=' + columns);
    if (!answer.ok) throw new Error();
    const view = new DataView(await answer.arrayBuffer());
    let at = 8; const news = new Map();
    for (const signal of signals) {
      const count = view.getUint32(at, true); at += 4;
      const times = new Float32Array(count), values = new Float32Array(count);
      for (let i = 0; i < count; i += 1, at += 8) { times[i] = view.getFloat32(at, true); values[i] = view.getFloat32(at + 4, true); }
      news.set(signal, { times, values });
    }
    data = news;
    draw();
  } catch { /* The next one is a new chance. */ }
  setTimeout(fetchData, 60);
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
  mark(pen, box, x);
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
      runs.push({ from: series.times[i], to, paint: 'shade-' + value % 8, words: it.states[value] || String(value) });
      i = last;
    }
    Plot.lane(pen, box, x, [box.top + place * each, each - 3], (it.label + ' ' + it.name).trim(), runs);
  });
  Plot.timeAxis(pen, box, view(), false);
  mark(pen, box, x);
  legend(plot, 'states', cursor === null ? [] : signals.map((it) => ['transparent', (it.label + ' ' + it.name).trim(), it.states[at(data.get(it.index), cursor)] || '–']));
}

function mark(pen, box, x) { if (cursor !== null) Plot.stroke(pen, [[x(cursor), box.top], [x(cursor), box.bottom]], Plot.style('text')); }

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
    span = Math.min(600, Math.max(0.02, span * factor));
    if (end !== null) end += (span - before) * (1 - place) * 1e6;
  };
  it.ondblclick = go;
}
const hold = () => { if (end === null) { end = state.now; } $('pause').textContent = 'Newest'; };
const go = () => { end = null; $('pause').textContent = 'Pause'; };
$('pause').onclick = () => end === null ? hold() : go();

for (const seconds of [1, 2, 5, 10, 30, 60, 120]) $('window').add(new Option(seconds + ' s', seconds, seconds === 10, seconds === 10));
for (const period of [1, 2, 5, 10]) $('period').add(new Option(period + ' ms', period, period === 10, period === 10));
$('window').onchange = () => { span = +$('window').value; keep(); };
$('period').onchange = watch;
$('search').oninput = tree; $('find').oninput = parameters;
$('record').onclick = () => attempt({ record: !state.record }).catch(() => {});
// What was pressed, and how far it has come: sent, done, not heard. It is sent until the robot has done it;
// the buttons say so within 200 ms, whether anything answers or not.
const pressed = { stop: null, disarm: null };
const WORDS = { stop: { sent: 'STOP sent …', done: 'STOPPED', 'not heard': 'STOP NOT HEARD' }, disarm: { sent: 'Disarm sent …', done: 'Disarmed', 'not heard': 'Disarm NOT HEARD' } };
function show() {
  for (const action of ['stop', 'disarm']) {
    const it = pressed[action], now = state[action] || (it && it.how) || '';
    if (it && it.how !== 'sent' && !state[action]) {
      it.how = 'done';
      if (performance.now() - it.at > 3000) pressed[action] = null;
    }
    $(action).firstChild.textContent = WORDS[action][now] || (action === 'stop' ? 'STOP ' : 'Disarm');
    $(action).className = now.replace(' ', '-');
  }
}
function urge(action) {
  held = null;
  const mine = pressed[action] = { how: 'sent', at: performance.now() };
  const come = (how) => { if (pressed[action] === mine) { mine.how = how; state[action] = how === 'done' ? null : how; show(); } };
  const late = setTimeout(() => come('not heard'), 190);
  post({ do: action }, true).then(() => { clearTimeout(late); say('refused', ''); come('done'); }, (error) => { clearTimeout(late); say('refused', String(error.message || error)); come('not heard'); });
  show();
}
$('disarm').onclick = () => urge('disarm');
$('stop').onclick = () => urge('stop');
// Before anything else on the page gets them. Where text is typed the space bar is a space.
const types = (it) => it && (it.tagName === 'TEXTAREA' || (it.tagName === 'INPUT' && it.type !== 'checkbox'));
for (const kind of ['keydown', 'keyup']) window.addEventListener(kind, (event) => {
  const space = event.code === 'Space' && !types(event.target);
  if (space) { event.preventDefault(); event.stopPropagation(); }
  if ((space || event.key === 'Escape') && kind === 'keydown' && !event.repeat) urge('stop');
}, true);
refresh(); fetchData();
