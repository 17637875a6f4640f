// Reads MCAP files with @mcap/core, by their index and as a stream: how many messages each has.
import { readFileSync } from 'node:fs';
import { McapIndexedReader, McapStreamReader } from '@mcap/core';
import { loadDecompressHandlers } from '@mcap/support';

const decompressHandlers = await loadDecompressHandlers();
const counts = [];
for (const file of process.argv.slice(2)) {
  const data = readFileSync(file);
  const readable = {
    size: async () => BigInt(data.length),
    read: async (offset, length) => data.subarray(Number(offset), Number(offset + length)),
  };
  const indexedReader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  let indexed = 0;
  for await (const _ of indexedReader.readMessages()) indexed += 1;

  const stream = new McapStreamReader({ decompressHandlers, validateCrcs: true });
  stream.append(data);
  let streamed = 0;
  for (let record; (record = stream.nextRecord()) !== undefined; ) {
    if (record.type === 'Message') streamed += 1;
  }
  if (!stream.done()) throw new Error(`${file} does not end`);
  counts.push({ indexed, streamed });
}
console.log(JSON.stringify(counts));
