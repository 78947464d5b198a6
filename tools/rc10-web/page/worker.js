// The other end of the page: a robot in the simulator, or its program on the emulated chip, as a WebAssembly module.
import { WASI, File, Directory, OpenFile, ConsoleStdout, PreopenDirectory } from './wasi/index.js';

const BEHIND = 100, SLICE = 8, TEXT = new TextEncoder(), LETTERS = new TextDecoder();
let rc10 = null, files = null, origin = 0, debts = 0, early = [];
const again = new MessageChannel();
again.port1.onmessage = run;

async function instance(module, all) {
  const root = new PreopenDirectory('/', new Map(Object.entries(all).map(([name, bytes]) => [name, new File(bytes)])));
  const said = () => ConsoleStdout.lineBuffered((line) => console.info(line));
  const wasi = new WASI([], ['RUST_BACKTRACE=0'], [new OpenFile(new File([])), said(), said(), root], { debug: false });
  const made = await WebAssembly.instantiate(module, { wasi_snapshot_preview1: wasi.wasiImport });
  wasi.initialize(made);
  return [made.exports, root];
}
const put = (to, ...parts) => {
  const bytes = parts.map((it) => typeof it === 'string' ? TEXT.encode(it) : it), size = bytes.reduce((sum, it) => sum + it.length, 0);
  let at = to.room(size);
  for (const it of bytes) { new Uint8Array(to.memory.buffer, at, it.length).set(it); at += it.length; }
  return bytes.map((it) => it.length);
};
const got = (from) => new Uint8Array(from.memory.buffer, from.at(), from.length()).slice();

// Real time, as far as this machine can follow.
function run() {
  if (!rc10) return;
  const begin = performance.now();
  let ahead;
  try {
    do {
      const now = rc10.step() * 1000;
      if (now < 0) { end(JSON.parse(LETTERS.decode(got(rc10)))); return; }
      while (debts > 0) { rc10.owed(); if (!pass(got(rc10))) break; debts -= 1; }
      ahead = origin + now - performance.now();
      if (ahead < -BEHIND) origin -= ahead;
    } while (ahead < 0 && performance.now() - begin < SLICE);
  } catch (error) { end({ error: String(error) }); return; }
  if (ahead < 0) again.port2.postMessage(null); else setTimeout(run, ahead);
}
function end(how) { rc10 = null; postMessage({ ended: how }); }

function pass(answer) {
  if (answer.length === 0) return false;
  const head = new DataView(answer.buffer), kind = 7 + head.getUint8(6), body = answer.slice(kind);
  postMessage({ id: head.getUint32(0, true), status: head.getUint16(4, true), kind: LETTERS.decode(answer.slice(7, kind)), body }, [body.buffer]);
  return true;
}
function ask({ id, isPost, target, body }) {
  const [length] = put(rc10, target, body);
  rc10.ask(id, isPost, length);
  if (!pass(got(rc10))) debts += 1;
}
// The newest file with this ending, in any folder.
function newest(ending) {
  const all = [];
  const walk = (folder, path) => folder.forEach((it, name) => it instanceof Directory ? walk(it.contents, path + name + '/') : all.push([path + name, it]));
  walk(files.dir.contents, '');
  const found = all.filter(([path]) => path.endsWith(ending)).sort(([one], [other]) => one < other ? -1 : 1).pop();
  return found ? { name: found[0].split('/').pop(), body: found[1].data.slice() } : null;
}

const DOES = {
  async begin({ module, robot, words, given }) {
    rc10 = null;
    const [made, root] = await instance(module, given);
    put(made, JSON.stringify({ robot, arguments: words }));
    made.begin();
    if (made.length() > 0) { end({ error: LETTERS.decode(got(made)) }); return; }
    [rc10, files, origin] = [made, root, performance.now()];
    for (const it of early.splice(0)) ask(it);
    run();
  },
  ask(it) { if (rc10) ask(it); else early.push(it); },
  newest({ id, ending }) { postMessage({ id, file: newest(ending) }); },
  // A command of `rc10` to its end, by an instance of its own.
  async command({ id, module, robot, words, given }) {
    const [made] = await instance(module, given);
    put(made, JSON.stringify({ robot, arguments: words }));
    made.command();
    const [code, ...text] = got(made);
    postMessage({ id, code, text: LETTERS.decode(new Uint8Array(text)) });
  },
};
onmessage = async ({ data: [what, it] }) => {
  try { await DOES[what](it); } catch (error) { end({ error: String(error) }); }
};
