// Tables of motors and buses; problems and events.
function buttons(place, motor) {
  const add = (text, title) => { const button = place.appendChild(document.createElement('button')); button.textContent = text; button.title = title; button.setAttribute('aria-label', text + ' ' + motor + ': ' + title); return button; };
  for (const [text, action, title] of [['Zero', 'zero', 'The angle now is zero; only while the robot is disarmed'], ['Clear', 'clear', 'Clear the fault']])
    add(text, title).onclick = () => post({ do: action, motor }).then(() => tellOf(motor, ''), (error) => tellOf(motor, String(error.message || error)));
  for (const [text, way, title] of [['−', -1, 'Turns slowly backwards while it is held, if the robot is disarmed and its table allows it'], ['+', 1, 'Turns slowly forwards while it is held, if the robot is disarmed and its table allows it']])
    holdable(add(text, title), () => jog(motor, way * $('jog').value), () => jog(motor, 0));
}
// A button that does something while it is held: by a pointer, or by Return.
function holdable(button, begin, end) {
  button.onpointerdown = (event) => { button.setPointerCapture(event.pointerId); begin(); };
  button.onkeydown = (event) => { if (event.key === 'Enter') { event.preventDefault(); if (!event.repeat) begin(); } };
  button.onkeyup = (event) => { if (event.key === 'Enter') end(); };
  for (const it of ['pointerup', 'pointercancel', 'lostpointercapture', 'blur']) button.addEventListener(it, end);
  button.oncontextmenu = (event) => event.preventDefault();
}
// Says something below a motor's row.
function tellOf(motor, words) {
  const row = [...$('motors').rows].find((it) => it.dataset.motor === motor);
  if (!row) return;
  let below = row.nextElementSibling;
  if (!below || below.dataset.motor) {
    if (!words) return;
    below = document.createElement('tr'); row.after(below);
    const it = cell(below, '', 'bad'); it.colSpan = row.cells.length; it.setAttribute('role', 'alert');
  }
  words ? below.cells[0].textContent = words : below.remove();
}

// The robot turns the motor for 80 ms: it is told again and again while the button is held, 25 ms after the word before or
// when that is answered. Gives why not.
let held = null;
async function jog(motor, speed) {
  const mine = speed ? {} : null;
  if (!speed && held === null) return null;
  held = mine;
  do {
    const next = new Promise((go) => setTimeout(go, 25));
    try { await post({ do: 'jog', motor, speed }); tellOf(motor, ''); } catch (error) { if (held === mine) held = null; const why = String(error.message || error); tellOf(motor, why); return why; }
    if (mine) await next;
  } while (mine && held === mine);
  if (mine) await post({ do: 'jog', motor, speed: 0 }).catch(() => {});
  return null;
}
window.addEventListener('blur', () => { held = null; });

// What target and measured number of a motor are in: without a target its speed is measured.
const UNITS = { Current: ' A', Torque: ' N m', Duty: '', Angle: '°', TotalAngle: '°', Impedance: '°', Motion: '°', Brake: ' A', Handbrake: ' A' };
function unitOf(label, isTarget) {
  const kind = named(label, 'target_kind');
  return UNITS[kind] === undefined || (kind === 'Duty' && !isTarget) ? ' rpm' : UNITS[kind];
}

function tables() {
  // Rows stay, because a button may be held.
  const motors = $('motors');
  let row;
  if (!motors.rows.length) {
    row = motors.insertRow();
    for (const head of ['motor', 'link', 'drive', 'target', 'measured', 'A', '°C', '']) { const th = document.createElement('th'); th.textContent = head; row.append(th); }
  }
  const have = new Map([...motors.rows].filter((row) => row.dataset.motor).map((row) => [row.dataset.motor, row]));
  labels('motors').forEach((label) => {
    row = have.get(label); have.delete(label);
    if (!row) {
      row = motors.insertRow(); row.dataset.motor = label;
      for (let count = 0; count < 8; count += 1) cell(row, '');
      const isGuest = document.body.classList.contains('guest'), open = row.cells[0].appendChild(document.createElement(isGuest ? 'span' : 'button'));
      open.className = 'plain'; open.textContent = label;
      if (!isGuest) { open.title = 'Tune this motor'; row.onclick = (event) => { if (!event.target.closest('button:not(.plain)')) openTune(label); }; }
      buttons(row.cells[7], label);
    }
    const link = named(label, 'link');
    row.cells[1].textContent = link; row.cells[1].className = link === 'Online' ? '' : 'bad';
    row.cells[2].textContent = named(label, 'drive');
    if (row.onclick) row.cells[0].firstChild.setAttribute('aria-expanded', label === tuned);
    row.cells[0].className = state.parameters.some((it) => it.label === label && !same(it.value, it.initial)) ? 'changed' : '';
    ['target', 'measured', 'current', 'temperature'].forEach((name, at) => { const it = value(label, name); row.cells[3 + at].textContent = number(it === null ? it : +it.toFixed(Math.abs(it) < 10 ? 2 : 1)) + (at < 2 && it !== null ? unitOf(label, at === 0) : ''); });
    // Without a drive it follows no target: what is left of one is no number to read.
    if (!['Run', 'Hold'].includes(named(label, 'drive'))) row.cells[3].textContent = '–';
  });
  for (const [label, row] of have) { tellOf(label, ''); row.remove(); }
  const buses = $('buses'); buses.replaceChildren();
  row = buses.insertRow();
  // A simulated tick takes no time.
  const isTimed = labels('buses').some((label) => value(label, 'execution_max') > 0);
  for (const head of ['bus', 'state', 'planned %', 'received', 'missed', 'lost', 'tick, µs'].slice(0, isTimed ? 7 : 6)) { const th = document.createElement('th'); th.textContent = head; row.append(th); }
  for (const label of labels('buses')) {
    row = buses.insertRow();
    cell(row, label);
    const errors = named(label, 'state'); cell(row, errors, errors === 'Active' ? '' : 'bad');
    for (const name of ['planned_typical', 'received', 'overruns', 'receive_lost', 'execution_max'].slice(0, isTimed ? 5 : 4)) cell(row, number(value(label, name)));
  }
  const list = [state.trouble, state.stranger].filter(Boolean).map((text) => ({ text, severity: 'problem' })).concat(state.problems || []);
  const bad = list.filter((it) => it.severity === 'problem'), known = list.filter((it) => it.severity !== 'problem');
  const items = (all) => all.map((it) => { const li = document.createElement('li'); li.className = it.severity; if (Number.isFinite(it.at)) li.append(when(it.at, it.signals)); li.append(document.createTextNode((it.about ? it.about + ': ' : '') + it.text)); if (it.severity === 'problem' && it.check) for (const name of ['check', 'do']) { const small = li.appendChild(document.createElement('small')); small.className = 'remedy'; for (const [tag, text] of [['b', name], ['span', it[name]]]) { small.append(' '); small.appendChild(document.createElement(tag)).textContent = text; } } return li; });
  fill('problems', bad.length ? bad : [{ text: state.file && !state.file.judged ? 'being looked for …' : 'none', severity: 'none' }], items);
  fill('known', known, items);
  const lately = (state.happened || []).filter(([at]) => !state.file || at * 1e6 <= end + 1).slice(-8).reverse();
  fill('happened', lately, (all) => all.map(([at, what]) => { const li = document.createElement('li'); li.append(when(at, []), document.createTextNode(what)); return li; }));
  $('happened').previousElementSibling.hidden = !lately.length;
  $('known').parentNode.hidden = !known.length; $('count').textContent = known.length;
}

// A list is made anew only if it changed: a button in it may be pressed.
const filled = {};
function fill(id, all, items) {
  const known = JSON.stringify(all);
  if (filled[id] !== known) { filled[id] = known; $(id).replaceChildren(...items(all)); }
}
