// Data of the robot, requests to it, and small helpers.
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

class Refused extends Error {}
// A browser opens six connections for all its tabs: the server lets three requests wait for the robot, and of one that is
// held up itself three stay free for STOP.
let flying = 0;
const post = async (wish, urgent = null) => {
  if (flying >= 3 && !urgent) throw new Error('the robot has not answered what was asked before');
  flying += 1;
  try {
    const asked = fetch('wish', { method: 'POST', headers: { 'Content-Type': 'application/json' }, body: JSON.stringify(wish), signal: urgent && AbortSignal.timeout(2000) });
    const answer = await asked.then((it) => it.json()).catch(() => { throw new Error('rc10 live has ended'); });
    if (answer.refused !== undefined) throw new Refused(answer.refused);
    return answer.ok;
  } finally { flying -= 1; }
};
const say = (id, text) => { $(id).textContent = text || ''; $(id).hidden = !text; };
const attempt = (wish) => post(wish).then((it) => { say('refused', ''); return it; }, (error) => { say('refused', String(error.message || error)); throw error; });
const number = (value) => value === null || value === undefined || Number.isNaN(value) ? '–'
  : Number.isSafeInteger(value) ? String(value) : Math.abs(value) >= 1e5 || (value !== 0 && Math.abs(value) < 1e-3) ? value.toExponential(2) : String(+value.toFixed(3));
const cell = (row, text, kind) => { const it = row.insertCell(); it.textContent = text; if (kind) it.className = kind; return it; };
const value = (label, name) => { const it = state.signals.find((it) => it.label === label && it.name === name); return it ? it.value : null; };
const named = (label, name) => { const it = state.signals.find((it) => it.label === label && it.name === name); return it && it.value !== null ? it.states[it.value] || '?' : '–'; };
const labels = (folder) => [...new Set(state.signals.filter((it) => it.folder === folder).map((it) => it.label))];
const key = (index) => { const it = state.signals.find((it) => it.index === index); return it ? it.folder + '/' + it.label + '/' + it.name : ''; };
