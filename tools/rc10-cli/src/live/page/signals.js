// The list of signals.
// The first look: what is remembered of the last time, or the first motor. Another robot has other numbers.
function begin() {
  begun = true;
  declaration = state.declaration; chosen = new Set(); data = new Map();
  let known = {};
  try { known = JSON.parse(localStorage.getItem('rc10')) || {}; } catch { /* private window */ }
  arrange(known);
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

// What the line does not carry is refused, and the page shows what it had before. States stay as they come if
// there is room for the numbers alone: they change seldom. Those of a motor that makes a step tell when it began.
const PAGE = crypto.getRandomValues(new Uint32Array(1))[0];
let had = null;
function watch() {
  if (!begun) return undefined;
  const wanted = { period: $('period').value, chosen: new Set(chosen) }, most = (state.fits || []).find(([period]) => period === +wanted.period);
  const all = [...chosen], numbers = all.filter((index) => { const it = state.signals.find((it) => it.index === index); return it && (!it.states.length || (testing && it.label === tuned)); });
  return post({ watch: most && all.length > most[1] ? numbers : all, period: +wanted.period, page: PAGE }).then(() => { had = wanted; }, (error) => {
    if (!(error instanceof Refused) || document.body.classList.contains('guest')) return;
    say('refused', String(error.message));
    $('period').value = had ? had.period : '10';
    if (had) chosen = new Set(had.chosen);
    keep(); tree();
  });
}

// How many signals the line carries, before one asks for them.
function fits() {
  for (const [period, most] of state.fits || []) {
    const option = [...$('period').options].find((it) => +it.value === period), text = period + ' ms, ' + most + ' signals';
    if (option && option.textContent !== text) option.textContent = text;
  }
  const slow = state.paces && state.paces[0] > state.often ? 'all else every ' + state.paces[0] + ' ms' : '';
  if ($('fits').textContent !== slow) $('fits').textContent = slow;
}
