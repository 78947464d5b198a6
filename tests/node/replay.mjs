// Runs a command of the page's module in Node: node replay.mjs MODULE FOLDER ROBOT WORD ..
import { readFileSync } from 'node:fs';
import { WASI } from 'node:wasi';

const [module, folder, robot, ...words] = process.argv.slice(2);
const wasi = new WASI({ version: 'preview1', preopens: { '/': folder } });
const { instance } = await WebAssembly.instantiate(readFileSync(module), wasi.getImportObject());
wasi.initialize(instance);
const { memory, room, command, at, length } = instance.exports;
const wish = new TextEncoder().encode(JSON.stringify({ robot, arguments: words }));
const place = room(wish.length);
new Uint8Array(memory.buffer).set(wish, place);
command();
const answer = new Uint8Array(memory.buffer, at(), length());
process.stdout.write(answer.slice(1));
process.exitCode = answer[0];
