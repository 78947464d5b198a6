/*BEFORE*/
// The page: asks for the state, and shows it.
let noted = { text: null, at: 0 };
async function refresh() {
  try {
    state = await (await fetch('state' + (state.file && end !== null ? '?at=' + Math.round(end) : ''))).json() || state;
    $('trouble').textContent = state.trouble || '';
    document.body.classList.remove('ended');
  } catch { $('trouble').textContent = 'rc10 live has ended'; document.body.classList.add('ended'); setTimeout(refresh, 1000); return; }
  $('name').textContent = state.name;
  if (state.note !== noted.text) noted = { text: state.note, at: performance.now() };
  say('note', state.stays || performance.now() - noted.at < 10000 ? state.note : '');
  const arm = named('', 'arm');
  $('arm').textContent = arm === 'EStopped' ? 'Stopped' : arm; $('arm').className = 'pill ' + arm;
  const stick = named('', 'not_at_rest');
  say('rest', stick === '–' || stick === 'all' ? '' : 'Not armed: ' + stick + ' is not at rest. Put it there and arm again.');
  show();
  $('record').textContent = state.record ? '■ ' + state.record.seconds.toFixed(0) + ' s' : '● Record';
  $('record').className = state.record ? 'on' : '';
  const losses = [['samples', 'samples lost on the way'], ['skipped', 'samples the line was too slow for'], ['damaged', 'damaged frames'], ['unknown', 'messages not understood'], ['left', 'signals without room']];
  if (!state.file) $('losses').textContent = losses.filter(([name]) => state.losses[name] > 0).map(([name, what]) => state.losses[name] + ' ' + what).join(' · ');
  fits();
  if (state.whole && (!begun || state.declaration !== declaration)) begin();
  time(); reports();
  $('log').hidden = !(state.log || []).length;
  const log = $('log').lastChild, lines = (state.log || []).join('\n');
  if ($('log').open && log.textContent !== lines) { log.textContent = lines; log.scrollTop = log.scrollHeight; }
  tables(); parameters(); tune(); kept(); Broken.show();
  setTimeout(refresh, 200);
}

// One view of the robot at a time, so that what belongs together is seen without scrolling.
const VIEWS = ['robot', 'motors', 'more'];
function look(view) {
  for (const it of VIEWS) {
    $('tab-' + it).hidden = it !== view;
    $('tabs').children[VIEWS.indexOf(it)].setAttribute('aria-selected', it === view);
  }
  try { localStorage.setItem('rc10-view', view); } catch { /* private window */ }
}
for (const view of VIEWS) {
  const tab = $('tabs').appendChild(document.createElement('button'));
  tab.textContent = $('tab-' + view).getAttribute('aria-label'); tab.setAttribute('role', 'tab'); tab.setAttribute('aria-controls', 'tab-' + view);
  tab.onclick = () => look(view);
}
{
  let view = null;
  try { view = localStorage.getItem('rc10-view'); } catch { /* private window */ }
  look(VIEWS.includes(view) ? view : 'motors');
}

for (const seconds of [1, 2, 5, 10, 30, 60, 120]) $('window').add(new Option(seconds + ' s', seconds, seconds === 10, seconds === 10));
for (const period of [1, 2, 5, 10]) $('period').add(new Option(period + ' ms', period, period === 10, period === 10));
setInterval(watch, 20000);
window.addEventListener('pagehide', () => fetch('wish', { method: 'POST', keepalive: true, headers: { 'Content-Type': 'application/json' }, body: JSON.stringify({ watch: [], period: 10, page: PAGE }) }));
$('window').onchange = () => { span = +$('window').value; keep(); };
$('period').onchange = () => { watch(); keep(); };
$('search').oninput = tree; $('find').oninput = parameters;
$('record').onclick = record;
$('mark').onclick = mark;
matchMedia('(prefers-color-scheme: dark)').addEventListener('change', Plot.restyle);
// Another device's address has a key, and may watch and stop.
document.body.classList.toggle('guest', location.pathname !== '/' && !window.inBrowser);
refresh(); fetchData(); Drive.talk(); View.draw();
