// Tables of motors and buses; problems and events.
function buttons(place, motor) {
  const add = (text, title) => { const button = place.appendChild(document.createElement('button')); button.textContent = text; button.title = title; button.setAttribute('aria-label', text + ' ' + motor + ': ' + title); button.style.padding = '0 5px'; return button; };
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
