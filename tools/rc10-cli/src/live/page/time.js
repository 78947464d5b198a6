// The time bar: where the window stands in what is known, and playing it.
// `end` is the window's end, µs, or null: the newest. A record has no newest: its page stands at a time.
let playing = null;              // the last time of the screen, ms, while it plays
let marked = [null, null];       // in and out, µs
const happened = new Map();      // what happened so far, by time and words: [seconds, words]
const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 4, 8];
const clock = (micros) => { const s = micros * 1e-6; return (s >= 60 ? Math.floor(s / 60) + ':' + (s % 60).toFixed(2).padStart(5, '0') : s.toFixed(2)) + ' s'; };
const extent = () => [Math.max(0, (state.begin || 0) - 0.03 * ((state.now || 0) - (state.begin || 0))), Math.max(1, state.now || 0)];
const place = () => end === null ? state.now || 0 : end;

// Where the data of signals begin, µs.
const beginOf = (indexes) => Math.min(...indexes.map((index) => { const it = state.signals.find((it) => it.index === index); return it && it.begin !== undefined ? it.begin : state.begin || 0; }), Infinity);

function seek(micros) {
  const [first, last] = extent();
  end = Math.min(last, Math.max(first, micros));
  if (end >= last && !state.file) go(); else $('pause').textContent = 'Newest';
  showTime();
}
function play(on) {
  playing = on ? performance.now() : null;
  if (on && end === null) { if (!state.file) hold(); else end = state.begin || 0; }
  if (on && state.file && end >= state.now) end = marked[0] === null ? state.begin || 0 : marked[0];
  if (on) requestAnimationFrame(step);
  $('play').textContent = on ? 'Halt' : 'Play';
}
function step(now) {
  if (playing === null) return;
  if (end === null) { play(false); return; }
  const last = marked[1] === null ? state.now : Math.min(marked[1], state.now);
  end += Math.max(0, now - playing) * 1000 * $('speed').value;
  playing = now;
  if (end >= last) {
    if (marked[1] !== null) end = marked[0] === null ? state.begin || 0 : marked[0];
    else if (state.file) { end = last; play(false); }
    else { play(false); go(); }
  }
  showTime();
  requestAnimationFrame(step);
}
// Leads to a time and its plot.
function jump(seconds, signals) {
  play(false);
  const wanted = state.signals.filter((it) => (signals || []).includes((it.label + ' ' + it.name).trim()) || (signals || []).includes(it.label));
  const room = 64 - wanted.length;
  if (wanted.length) { chosen = new Set([...[...chosen].slice(0, Math.max(0, room)), ...wanted.slice(0, 64).map((it) => it.index)]); tree(); watch(); keep(); }
  lead = seconds;
  seek(seconds * 1e6 + span * 5e5);
  const unit = wanted.length && (wanted[0].states.length ? 'states' : wanted[0].unit || 'number');
  const plot = unit && [...$('plots').children].find((it) => it.dataset.unit === unit);
  if (plot) plot.scrollIntoView({ block: 'nearest' });
}
let lead = null;                 // the time that was led to, seconds

// A button that leads to a time.
function when(seconds, signals) {
  const button = document.createElement('button');
  button.className = 'when'; button.textContent = seconds.toFixed(2) + ' s'; button.title = 'Show this time';
  button.onclick = () => jump(seconds, signals);
  return button;
}
// Marks of events and problems between two times, in seconds: [time, words, paint].
function marks([from, to]) {
  const within = ([at]) => at >= from && at <= to;
  const bad = (state.problems || []).filter((it) => Number.isFinite(it.at) && it.severity === 'problem').map((it) => [it.at, it.headline || it.text, 'bad']);
  return [...happened.values()].map(([at, what]) => [at, what, 'muted']).concat(bad).filter(within).sort((one, other) => one[0] - other[0]);
}
function remember() {
  for (const [at, what] of state.happened || []) {
    // Judged again and again, its time moves by some samples.
    const key = [0, -1, 1].map((by) => Math.round(at * 2 + by) + what).find((it) => happened.has(it)) || Math.round(at * 2) + what;
    if (!happened.has(key)) happened.set(key, [at, what]);
    if (happened.size > 1000) happened.delete(happened.keys().next().value);
  }
  for (const [key, [at]] of happened) if (at * 1e6 > (state.now || 0) + 1e6) happened.delete(key);
}

function showTime() {
  const bar = $('scrub'), [first, last] = extent(), now = place();
  if (!bar) return;
  const { pen, width, height } = Plot.open(bar), box = { left: 6, right: width - 6, top: 2, bottom: height - 16 };
  const x = Plot.across(box, [first * 1e-6, last * 1e-6]);
  pen.fillStyle = Plot.style('rule'); pen.fillRect(box.left, box.top, box.right - box.left, box.bottom - box.top);
  const begin = beginOf([...chosen]);
  if (Number.isFinite(begin) && begin > first) Plot.hatch(pen, { ...box, right: Math.max(box.left + 3, x(begin * 1e-6)) });
  const block = (from, to, paint) => { pen.globalAlpha = 0.35; pen.fillStyle = Plot.style(paint); const left = Math.max(box.left, x(from * 1e-6)); pen.fillRect(left, box.top, Math.max(2, x(to * 1e-6) - left), box.bottom - box.top); pen.globalAlpha = 1; };
  if (marked[0] !== null || marked[1] !== null) block(marked[0] === null ? first : marked[0], marked[1] === null ? last : marked[1], 'good');
  block(Math.max(first, now - span * 1e6), now, 'line-0');
  for (const [at, , paint] of marks([first * 1e-6, last * 1e-6])) Plot.stroke(pen, [[x(at), box.top], [x(at), box.bottom]], Plot.style(paint), paint === 'bad' ? 2 : 1);
  Plot.stroke(pen, [[x(now * 1e-6), box.top], [x(now * 1e-6), box.bottom]], Plot.style('text'), 2);
  Plot.timeAxis(pen, box, [first * 1e-6, last * 1e-6], false);
  bar.setAttribute('aria-valuemin', (first * 1e-6).toFixed(2)); bar.setAttribute('aria-valuemax', (last * 1e-6).toFixed(2));
  bar.setAttribute('aria-valuenow', (now * 1e-6).toFixed(2)); bar.setAttribute('aria-valuetext', clock(now));
  $('at').textContent = clock(now);
  $('live').hidden = !!state.file; $('live').setAttribute('aria-pressed', end === null);
}

// Called with each state.
function time() {
  if (state.file) {
    document.body.classList.add('file');
    if (end === null) end = Math.min(state.now, (state.begin || 0) + span * 1e6);
    if (!$('title').textContent) { $('title').textContent = state.file.title || ''; $('about').textContent = state.file.note || ''; }
  }
  if (state.now && happened.size && state.now < 1e6) happened.clear();
  remember(); showTime();
}

{
  const row = $('time'), make = (tag, id, text, label) => { const it = row.appendChild(document.createElement(tag)); it.id = id; it.textContent = text; if (label) { it.title = label; it.setAttribute('aria-label', text ? text + ': ' + label : label); } return it; };
  make('button', 'play', 'Play', '').onclick = () => play(playing === null);
  const speed = make('select', 'speed', '', 'Speed');
  for (const it of SPEEDS) speed.add(new Option('× ' + it, it, it === 1, it === 1));
  make('button', 'in', 'In', 'Playing begins here (I)').onclick = () => limit(0);
  make('button', 'out', 'Out', 'Playing ends here, and begins anew (O)').onclick = () => limit(1);
  make('span', 'at', '');
  const bar = make('canvas', 'scrub', '', 'Time');
  bar.tabIndex = 0; bar.setAttribute('role', 'slider');
  make('button', 'live', 'Live', 'Back to the newest (L)').onclick = () => { play(false); go(); showTime(); };
  const to = (event) => { const [first, last] = extent(); play(false); lead = null; seek(first + (event.offsetX - 6) / (bar.clientWidth - 12) * (last - first)); };
  bar.onpointerdown = (event) => { bar.setPointerCapture(event.pointerId); to(event); };
  bar.onpointermove = (event) => { if (event.buttons & 1) to(event); else { const [first, last] = extent(), at = (first + (event.offsetX - 6) / (bar.clientWidth - 12) * (last - first)) * 1e-6, near = marks([at - (last - first) * 5e-9, at + (last - first) * 5e-9]); bar.title = near.length ? near.map(([, what]) => what).join(', ') : 'Time'; } };
  bar.onkeydown = (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1, PageUp: 10, PageDown: -10 }[event.key], [first, last] = extent();
    if (by) seek(place() + by * span * (event.shiftKey ? 1e6 : 1e5));
    else if (event.key === 'Home') seek(beginOf([...chosen]) < Infinity ? beginOf([...chosen]) : first);
    else if (event.key === 'End') seek(last);
    else return;
    lead = null; play(false); event.preventDefault();
  };
  // A second time takes the mark away.
  const limit = (which) => { const now = place(); marked[which] = marked[which] !== null && Math.abs(marked[which] - now) < 1000 ? null : now; if (marked[0] !== null && marked[1] !== null && marked[0] >= marked[1]) marked[1 - which] = null; showTime(); };
  window.addEventListener('keydown', (event) => {
    if (event.defaultPrevented || event.ctrlKey || event.metaKey || event.altKey || types(event.target) || event.target.tagName === 'SELECT') return;
    if (event.code === 'Space' && state.file) { event.preventDefault(); if (!event.repeat) play(playing === null); }
    else if (event.repeat) return;
    else if (event.key === 'i') limit(0);
    else if (event.key === 'o') limit(1);
    else if (event.key === 'l' && !state.file) { play(false); go(); }
    else if (event.key === 'm' && !state.file) mark();
  });
}

// Records: a moment is marked, a record has a name and a note, and its report is a click away.
function mark() { if (state.now && !state.file) attempt({ mark: $('words').value.trim() }).then(() => { $('words').value = ''; }, () => {}); }
async function record() {
  const on = !state.record;
  await attempt({ record: on, name: $('title-of').value, note: $('note-of').value }).then(() => { if (!on) { $('title-of').value = ''; $('note-of').value = ''; } }, () => {});
}
function reports() {
  const told = { making: 'The report is being made …', ready: 'Report' }[state.report];
  $('report').hidden = state.report !== 'ready'; $('making').hidden = state.report !== 'making';
  if (told && state.report === 'ready') $('report').textContent = told;
}

// A picture and the numbers of a plot.
function save(name, blob) { const it = document.createElement('a'); it.href = URL.createObjectURL(blob); it.download = name; it.click(); setTimeout(() => URL.revokeObjectURL(it.href), 1000); }
const fileName = (plot, kind) => 'rc10-' + plot.dataset.unit.replace(/[^a-z0-9]+/gi, '-') + '-' + (place() * 1e-6).toFixed(2) + '.' + kind;
function savePicture(plot) {
  const canvas = plot.querySelector('canvas'), ratio = window.devicePixelRatio || 1, lines = [...plot.querySelectorAll('.legend span')].map((it) => [it.textContent, it.querySelector('i') ? it.querySelector('i').style.background : '']), head = 18 * lines.length * ratio;
  const whole = document.createElement('canvas'); whole.width = canvas.width; whole.height = canvas.height + head;
  const pen = whole.getContext('2d');
  pen.fillStyle = getComputedStyle(plot).backgroundColor; pen.fillRect(0, 0, whole.width, whole.height);
  pen.scale(ratio, ratio); pen.font = Plot.FONT;
  lines.forEach(([text, colour], at) => { pen.fillStyle = colour || Plot.style('muted'); pen.fillRect(8, 18 * at + 8, colour ? 14 : 0, 3); pen.fillStyle = Plot.style('text'); Plot.text(pen, text, 28, 18 * at + 4, 'left', 'top'); });
  pen.setTransform(1, 0, 0, 1, 0, 0); pen.drawImage(canvas, 0, head);
  whole.toBlob((blob) => save(fileName(plot, 'png'), blob));
}
async function saveNumbers(plot) {
  const of = (it) => it.states.length ? 'states' : it.unit || 'number', wanted = state.signals.filter((it) => chosen.has(it.index) && of(it) === plot.dataset.unit), begin = from;
  const answer = await fetch('data?signals=' + wanted.map((it) => it.index).join(',') + '&from=' + begin + '&to=' + Math.round(begin + span * 1e6) + '&columns=10000');
  const view = new DataView(await answer.arrayBuffer()), rows = new Map(); let at = 8;
  wanted.forEach((it, column) => { const count = view.getUint32(at, true); at += 4; for (let i = 0; i < count; i += 1, at += 8) { const time = (begin * 1e-6 + view.getFloat32(at, true)).toFixed(6); if (!rows.has(time)) rows.set(time, new Array(wanted.length).fill('')); const value = view.getFloat32(at + 4, true); rows.get(time)[column] = Number.isNaN(value) ? '' : String(+value.toPrecision(7)); } });
  const quoted = (text) => '"' + text.replace(/"/g, '""') + '"', head = ['time_s', ...wanted.map((it) => quoted((it.label + ' ' + it.name).trim() + (it.unit ? ', ' + it.unit : '')))];
  save(fileName(plot, 'csv'), new Blob([[head, ...[...rows].sort((one, other) => one[0] - other[0]).map(([time, values]) => [time, ...values])].map((row) => row.join(',')).join('\r\n') + '\r\n'], { type: 'text/csv' }));
}
