// STOP and Disarm.
// What was pressed, and how far it has come: sent, done, not heard. It is sent until the robot has done it, also to a
// `rc10 live` that comes back; the buttons say so within 200 ms, whether anything answers or not.
const pressed = { stop: null, disarm: null };
const WORDS = { stop: { sent: 'STOP sent …', done: 'STOPPED', 'not heard': 'STOP NOT HEARD' }, disarm: { sent: 'Disarm sent …', done: 'Disarmed', 'not heard': 'Disarm NOT HEARD' } };
function show() {
  for (const action of ['stop', 'disarm']) {
    const it = pressed[action], now = state[action] || (it && it.how) || '';
    if (it && it.how === 'done' && performance.now() - it.at > 3000) pressed[action] = null;
    $(action).firstChild.textContent = WORDS[action][now] || (action === 'stop' ? 'STOP ' : 'Disarm');
    $(action).className = now.replace(' ', '-');
  }
}
async function urge(action) {
  held = null; Drive.rest();
  const mine = pressed[action] = { how: 'sent' }, isLast = () => pressed[action] === mine;
  const come = (how) => { if (isLast()) { mine.how = how; mine.at = performance.now(); state[action] = how === 'done' ? null : how; show(); } };
  const late = setTimeout(() => come('not heard'), 190);
  show();
  while (isLast() && mine.how !== 'done') {
    const next = new Promise((go) => setTimeout(go, 200));
    const [how, why] = await post({ do: action }, true).then(() => ['done', ''], (error) => ['not heard', String(error.message || error)]);
    clearTimeout(late);
    if (isLast()) say('refused', why);
    come(how);
    await next;
  }
}
$('disarm').onclick = () => urge('disarm');
$('stop').onclick = () => urge('stop');
// Before anything else on the page gets them. Where text is typed the space bar is a space.
const types = (it) => it && (it.tagName === 'TEXTAREA' || (it.tagName === 'INPUT' && !['checkbox', 'range'].includes(it.type)));
for (const kind of ['keydown', 'keyup']) window.addEventListener(kind, (event) => {
  // A record has no robot: there the space bar plays.
  if (state.file) return;
  const space = event.code === 'Space' && !types(event.target);
  if (space) { event.preventDefault(); event.stopPropagation(); }
  if ((space || event.key === 'Escape') && kind === 'keydown' && !event.repeat) urge('stop');
}, true);
