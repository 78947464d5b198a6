// The list of signals.
// The first look: what is remembered of the last time, or the first motor. Another robot has other numbers.
function begin() {
  begun = true;
  declaration = state.declaration; chosen = new Set(); data = new Map(); undo = [];
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

const watch = () => post({ watch: [...chosen], period: +$('period').value }).catch(() => {});
