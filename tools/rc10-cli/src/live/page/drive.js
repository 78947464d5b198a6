// The remote in the hand: keyboard, gamepad and mouse, through the receiver of a robot that is simulated here.
let moving = {};        // what moves: the remote, the base
const Drive = (() => {
  const AXES = 5, SIDES = ['Left', 'Right'], SWITCHES = ['left', 'right', 'third', 'fourth'], PLACES = [[1, 'up'], [0, 'middle'], [-1, 'down']];
  // [code, axis, way]: W A S D move the left stick, the arrows the right one.
  const STICKS = { KeyD: [0, 1], KeyA: [0, -1], KeyW: [1, 1], KeyS: [1, -1], ArrowRight: [2, 1], ArrowLeft: [2, -1], ArrowUp: [3, 1], ArrowDown: [3, -1] };
  // A step of a switch, by key and by button of a gamepad.
  const STEPS = { KeyQ: [0, 1], KeyZ: [0, -1], KeyE: [1, 1], KeyC: [1, -1] }, BUTTONS = { 4: [0, 1], 6: [0, -1], 5: [1, 1], 7: [1, -1] };
  const DEAD = 0.08;    // of a worn gamepad's sticks, and what of them is at rest
  let mine = null, message = 0, switches = [0, 0, 0, 0], dial = 0, told = '', sent = '';
  let keys = new Set(), dragged = [null, null], pad = { held: new Set(), rested: false }, away = false, wake = null;
  let drawn = null;

  // Sticks in the middle until they are moved anew; the switches stay.
  function rest() {
    keys = new Set(); dragged = [null, null]; dial = 0; pad.rested = false;
    if (drawn) drawn.dial.value = 0;
    kick();
  }
  const kick = () => { if (wake) wake(); };
  const step = ([at, way]) => { switches[at] = Math.max(-1, Math.min(1, switches[at] + way)); kick(); };

  function gamepad() {
    const all = navigator.getGamepads ? [...navigator.getGamepads()] : [];
    return all.find((it) => it && it.connected && it.mapping === 'standard') || null;
  }
  // A gamepad counts from when its sticks were in their middle.
  function ofPad() {
    const it = away ? null : gamepad();
    if (!it) { pad.rested = false; return [0, 0, 0, 0]; }
    const axes = [0, 1, 2, 3].map((at) => {
      const way = (at % 2 ? -1 : 1) * (Number.isFinite(it.axes[at]) ? it.axes[at] : 0), size = Math.min(1, Math.abs(way));
      return size < DEAD ? 0 : Math.sign(way) * (size - DEAD) / (1 - DEAD);
    });
    const held = new Set(Object.keys(BUTTONS).filter((at) => it.buttons[at] && it.buttons[at].pressed));
    for (const at of held) if (!pad.held.has(at) && pad.rested) step(BUTTONS[at]);
    pad.held = held;
    if (axes.every((axis) => axis === 0)) pad.rested = true;
    return pad.rested ? axes : [0, 0, 0, 0];
  }
  function positions() {
    const sum = ofPad();
    for (const code of keys) if (STICKS[code]) sum[STICKS[code][0]] += STICKS[code][1];
    dragged.forEach((it, side) => { if (it) [sum[2 * side], sum[2 * side + 1]] = it; });
    return [...sum.map((axis) => Math.max(-1, Math.min(1, axis))), dial, ...switches];
  }

  // One message at a time, beside all others, so that none waits for another and STOP for none.
  async function ask(wish) {
    const answer = await fetch('drive', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(wish), signal: AbortSignal.timeout(1000) });
    const value = await answer.json();
    if (value.refused !== undefined) throw Object.assign(new Error(value.refused), { isRefused: true });
    return value;
  }
  async function talk() {
    for (;;) {
      const begin = performance.now(), number = mine;
      try {
        if (number !== null) {
          const at = positions();
          sent = String(at);
          moving = await ask([number, message += 1, ...at]);
        }
        else moving = await (await fetch('moving', { signal: AbortSignal.timeout(1000) })).json() || {};
        show();
      } catch (error) {
        // Only a refusal tells so: what is shown may be older than the remote's taking.
        if (error.isRefused && mine === number) { mine = null; told = 'Another page has taken the remote.'; show(); }
      }
      const every = mine !== null ? 20 : document.hidden || $('tab-robot').hidden ? 500 : 50;
      await new Promise((go) => { wake = go; setTimeout(go, Math.max(2, every - (performance.now() - begin))); });
      wake = null;
    }
  }
  // What moved while a message was on its way, and a gamepad, which tells nothing by itself.
  setInterval(() => { if (mine !== null && wake && String(positions()) !== sent) kick(); }, 4);
  async function take() {
    try {
      const got = await ask('take');
      told = ''; message = 0; switches = got.at.slice(AXES); rest(); mine = got.number;
    } catch (error) { told = ''; say('refused', String(error.message || error)); }
    kick();
  }
  async function leave() {
    const number = mine;
    mine = null; rest();
    if (number !== null) await ask([number]).catch(() => {});
  }

  // ---- the panel -----------------------------------------------------------------------------
  const add = (place, tag, text, kind) => { const it = place.appendChild(document.createElement(tag)); if (text) it.textContent = text; if (kind) it.className = kind; return it; };
  function picture(place, side) {
    const figure = add(place, 'figure');
    figure.innerHTML = '<svg viewBox="-57 -57 114 114"><circle class="rim" r="44"/><path class="cross" d="M-44 0H44M0-44V44"/><circle class="heard" r="7"/><circle class="knob" r="11"/></svg>';
    const svg = figure.firstChild, move = (event) => {
      const box = svg.getBoundingClientRect(), reach = 44 / 114 * box.width;
      const [x, y] = [(event.clientX - box.left - box.width / 2) / reach, (box.top + box.height / 2 - event.clientY) / reach], far = Math.max(1, Math.hypot(x, y));
      dragged[side] = [x / far, y / far]; kick();
    };
    svg.setAttribute('role', 'img'); svg.setAttribute('aria-label', SIDES[side] + ' stick');
    svg.onpointerdown = (event) => { if (mine === null) return; svg.setPointerCapture(event.pointerId); move(event); };
    svg.onpointermove = (event) => { if (dragged[side]) move(event); };
    for (const end of ['pointerup', 'pointercancel', 'lostpointercapture']) svg.addEventListener(end, () => { dragged[side] = null; kick(); });
    return { knob: svg.querySelector('.knob'), heard: svg.querySelector('.heard'), text: add(figure, 'figcaption') };
  }
  function lever(place, at) {
    const group = add(place, 'div', '', 'lever');
    group.setAttribute('role', 'group'); group.setAttribute('aria-label', SWITCHES[at] + ' switch');
    const buttons = PLACES.map(([value, name]) => {
      const button = add(group, 'button', name);
      button.dataset.at = value;
      button.onclick = () => { switches[at] = value; kick(); };
      return button;
    });
    add(group, 'small', SWITCHES[at] + ' switch');
    return { group, buttons };
  }
  function build() {
    const place = $('drive');
    add(place, 'h2', 'Remote');
    const line = add(place, 'p', '', 'hands'), who = add(line, 'span'), what = add(line, 'b'), buttons = {};
    line.setAttribute('role', 'status');
    const bar = add(place, 'p', '', 'hands');
    for (const [name, text, act] of [['take', 'Take the remote', take], ['leave', 'Let it go', leave], ['script', 'Let the script drive', () => { mine = null; ask('script').catch(() => {}); }]])
      (buttons[name] = add(bar, 'button', text)).onclick = () => act();
    const pace = add(bar, 'span', '', 'bad'), sticks = add(place, 'div', '', 'sticks');
    drawn = { who, what, buttons, pace, levers: [], sticks: [] };
    for (const [side, at] of [[0, 0], [1, 1]]) {
      if (side) drawn.levers.push(lever(sticks, at));
      drawn.sticks.push(picture(sticks, side));
      if (!side) drawn.levers.push(lever(sticks, at));
    }
    for (let at = 2; at < moving.remote.switches; at += 1) drawn.levers.push(lever(sticks, at));
    const label = add(add(place, 'p', '', 'hands'), 'label', 'dial ');
    drawn.dial = add(label, 'input');
    Object.assign(drawn.dial, { type: 'range', min: -1, max: 1, step: 0.05, value: 0 });
    drawn.dial.oninput = () => { dial = +drawn.dial.value; kick(); };
    drawn.pad = add(label.parentNode, 'small');
    const safe = moving.remote.safe.slice(AXES).findIndex((it) => it !== 0), first = safe < 0 ? 1 : safe;
    const [, name] = PLACES.find(([value]) => value === moving.remote.safe[AXES + first]);
    add(place, 'p', 'To arm: ' + SWITCHES[first] + ' switch to ' + name + ', sticks in the middle, then the switch out of there.', 'hint');
    add(place, 'p', 'Keys: W A S D left stick · arrows right stick · Q Z left switch · E C right switch', 'hint');
    add(place, 'p', 'Gamepad: both sticks · L1 L2 left switch · R1 R2 right switch', 'hint');
  }
  function show() {
    const remote = moving.remote;
    $('drive').hidden = !remote;
    if (!remote) { drawn = null; mine = null; $('drive').replaceChildren(); return; }
    if (!drawn) build();
    const isMine = mine !== null;
    const who = isMine ? 'This page holds the remote.' : told && remote.holder !== 'table' && remote.holder !== 'script' ? told
      : remote.holder === 'script' ? 'The script holds the remote: ' : remote.holder === 'table' ? (remote.on ? 'The remote lies there, switched on.' : 'The remote is switched off.') : 'Another page holds the remote.';
    const put = (it, text) => { if (it.dataset.text !== text) { it.dataset.text = text; it.textContent = text; } };
    put(drawn.who, who);
    put(drawn.what, remote.holder === 'script' && !isMine ? remote.script || '' : isMine && away ? 'The page is not in front: sticks in the middle.' : !remote.on && remote.holder !== 'table' ? 'Its transmitter is off.' : '');
    drawn.buttons.take.hidden = isMine; drawn.buttons.leave.hidden = !isMine; drawn.buttons.script.hidden = remote.holder === 'script' && !isMine;
    put(drawn.pace, moving.pace !== null && moving.pace < 0.95 ? 'time runs at ' + moving.pace.toFixed(1) + ' of real time' : '');
    drawn.sticks.forEach(({ knob, heard, text }, side) => {
      const [x, y] = remote.at.slice(2 * side, 2 * side + 2), name = side ? 'right' : 'left';
      const has = ['_x', '_y'].map((axis) => value('', name + axis) || 0);
      for (const [it, [right, up]] of [[knob, [x, y]], [heard, has]]) { it.setAttribute('cx', 44 * right); it.setAttribute('cy', -44 * up); }
      put(text, x.toFixed(2) + '  ' + y.toFixed(2));
    });
    drawn.levers.forEach(({ buttons }, at) => buttons.forEach((button) => {
      button.setAttribute('aria-pressed', +button.dataset.at === remote.at[AXES + at]); button.disabled = !isMine;
    }));
    drawn.dial.disabled = !isMine; if (!isMine) drawn.dial.value = remote.at[4];
    put(drawn.pad, gamepad() ? 'a gamepad is there' : 'no gamepad: press a button of it');
  }

  // ---- keys and focus ------------------------------------------------------------------------
  const isText = (it) => it && ['INPUT', 'SELECT', 'TEXTAREA'].includes(it.tagName);
  window.addEventListener('keydown', (event) => {
    const { code } = event;
    if (mine === null || away || isText(event.target) || event.ctrlKey || event.altKey || event.metaKey || !(STICKS[code] || STEPS[code])) return;
    event.preventDefault();
    if (event.repeat) return;
    if (STEPS[code]) step(STEPS[code]); else { keys.add(code); kick(); }
  });
  window.addEventListener('keyup', ({ code }) => { if (keys.delete(code)) kick(); });
  window.addEventListener('focusin', (event) => { if (isText(event.target) && event.target !== (drawn && drawn.dial)) rest(); });
  window.addEventListener('blur', () => { away = true; rest(); });
  window.addEventListener('focus', () => { away = false; });
  document.addEventListener('visibilitychange', () => { if (document.hidden) { away = true; rest(); } else away = false; });
  // The tab is closed: the remote is lost at once, not only when its word is missing.
  window.addEventListener('pagehide', () => {
    if (mine !== null) fetch('drive', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify([mine]), keepalive: true }).catch(() => {});
    mine = null;
  });
  return { rest, talk, take, holds: () => mine };
})();
