// What a page shows, kept by the browser and shared as a file: signals by their names, window, period.
const LAYOUT = 'rc10 layout 1';
const layout = () => ({ form: LAYOUT, chosen: [...chosen].map(key), span, period: +$('period').value });
const keep = () => { try { localStorage.setItem('rc10', JSON.stringify(layout())); } catch { /* private window */ } };

// Takes a layout over, as far as this robot has its signals; says which it lacks.
function arrange(known) {
  const wanted = Array.isArray(known.chosen) ? known.chosen.filter((it) => typeof it === 'string').slice(0, 64) : [];
  const numbers = new Map(state.signals.map((it) => [it.folder + '/' + it.label + '/' + it.name, it.index]));
  chosen = new Set(wanted.filter((it) => numbers.has(it)).map((it) => numbers.get(it)));
  if (known.span >= 0.02 && known.span <= 1800) { span = known.span; $('window').value = String(span); }
  if ([...$('period').options].some((it) => +it.value === known.period)) $('period').value = String(known.period);
  return wanted.filter((it) => !numbers.has(it));
}

$('layout-save').onclick = () => {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(new Blob([JSON.stringify(layout(), null, 1)], { type: 'application/json' }));
  link.download = 'rc10-layout.json'; link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
};
$('layout-open').onclick = () => $('layout-file').click();
$('layout-file').onchange = async () => {
  const [file] = $('layout-file').files;
  if (!file) return;
  try {
    if (file.size > 65536) throw new Error('it is too long');
    const known = JSON.parse(await file.text());
    if (!known || known.form !== LAYOUT) throw new Error('it is no layout of this page');
    const lacks = arrange(known);
    say('refused', lacks.length ? 'This robot does not have: ' + lacks.join(', ') : '');
    tree(); watch(); keep();
  } catch (error) { say('refused', file.name + ': ' + error.message); }
  $('layout-file').value = '';
};
