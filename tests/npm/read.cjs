// node read.cjs FILE CAT: reads FILE (MCAP) with @mcap/core, from beginning to end and by its index, with every CRC
// checked, decodes each message with @foxglove/omgidl-serialization, and compares all with CAT, what
// `hamel log cat FILE --json` printed.  Says what it read as JSON; exit code 1 with a sentence where anything differs.
"use strict";
const fs = require("fs");
const { McapIndexedReader, McapStreamReader } = require("@mcap/core");
const { parseIDL } = require("@foxglove/omgidl-parser");
const { MessageReader } = require("@foxglove/omgidl-serialization");
const lz4 = require("@foxglove/wasm-lz4");
const zstd = require("@foxglove/wasm-zstd");

function fail(sentence) {
  console.error(sentence);
  process.exit(1);
}

async function decompressors() {
  await lz4.isLoaded;
  await zstd.isLoaded;
  return {
    lz4: (buffer, size) => lz4(buffer, Number(size)),
    zstd: (buffer, size) => zstd.decompress(buffer, Number(size)),
  };
}

// Whole numbers of more than 15 digits would be rounded: they stay text.
function parseLine(line) {
  return JSON.parse(line.replace(/([:,[])(\d{16,})(?=[,}\]])/g, '$1"$2"'));
}

// Ours against theirs: bigints and typed arrays on their side, null for +inf on ours.
function compare(ours, theirs, path) {
  if (ours === null) return theirs === Infinity ? [] : [`${path}: inf, ${theirs}`];
  if (ArrayBuffer.isView(theirs)) theirs = Array.from(theirs);
  if (Array.isArray(ours) || Array.isArray(theirs)) {
    if (!Array.isArray(ours) || !Array.isArray(theirs) || ours.length !== theirs.length)
      return [`${path}: ${JSON.stringify(ours)} is not as long as theirs`];
    return ours.flatMap((o, i) => compare(o, theirs[i], `${path}[${i}]`));
  }
  if (typeof ours === "object") {
    const names = new Set([...Object.keys(ours), ...Object.keys(theirs)]);
    return [...names].flatMap((n) =>
      n in ours && n in theirs ? compare(ours[n], theirs[n], `${path}.${n}`) : [`${path}.${n}: only on one side`]);
  }
  const same = typeof theirs === "bigint" ? String(ours) === String(theirs) : Object.is(ours, theirs);
  return same ? [] : [`${path}: ${ours}, ${theirs}`];
}

async function indexed(file, decompressHandlers) {
  const bytes = fs.readFileSync(file);
  const readable = {
    size: async () => BigInt(bytes.length),
    read: async (offset, length) => new Uint8Array(bytes.buffer, bytes.byteOffset + Number(offset), Number(length)),
  };
  const reader = await McapIndexedReader.Initialize({ readable, decompressHandlers });
  const messages = [];
  for await (const m of reader.readMessages({ validateCrcs: true })) messages.push(m);
  const attachments = [];
  for await (const a of reader.readAttachments({ validateCrcs: true })) attachments.push(a.name);
  const metadata = [];
  for await (const m of reader.readMetadata()) metadata.push(m.name);
  return { reader, messages, attachments, metadata };
}

function streamed(file, decompressHandlers) {
  const reader = new McapStreamReader({ decompressHandlers, validateCrcs: true, includeChunks: true });
  reader.append(fs.readFileSync(file));
  const found = { messages: [], channels: new Map(), schemas: new Map(), chunks: new Map() };
  for (let record; (record = reader.nextRecord()); ) {
    if (record.type === "Message") found.messages.push({ ...record, data: record.data.slice() });
    if (record.type === "Channel") found.channels.set(record.id, record);
    if (record.type === "Schema") found.schemas.set(record.id, record);
    if (record.type === "Chunk") found.chunks.set(record.compression, (found.chunks.get(record.compression) ?? 0) + 1);
  }
  if (!reader.done()) fail(`${file}: the stream reader is not done`);
  return found;
}

async function main() {
  const [file, cat] = process.argv.slice(2);
  const handlers = await decompressors();
  const stream = streamed(file, handlers);
  const index = await indexed(file, handlers);
  const lines = fs.readFileSync(cat, "utf8").split("\n").filter((l) => l).map(parseLine);
  if (stream.messages.length !== lines.length || index.messages.length !== lines.length)
    fail(`${file}: ${stream.messages.length} streamed, ${index.messages.length} by index, ${lines.length} of ours`);
  if (Number(index.reader.statistics.messageCount) !== lines.length) fail(`${file}: the statistics count otherwise`);
  for (let i = 1; i < index.messages.length; ++i)
    if (index.messages[i].logTime < index.messages[i - 1].logTime) fail(`${file}: by index, time goes backwards at ${i}`);

  const readers = new Map(), types = new Set();
  stream.messages.forEach((m, i) => {
    const channel = stream.channels.get(m.channelId);
    const schema = stream.schemas.get(channel.schemaId);
    if (!readers.has(schema.id)) {
      if (schema.encoding !== "omgidl" || channel.messageEncoding !== "cdr") fail(`${file}: wrong encodings`);
      readers.set(schema.id, new MessageReader(schema.name, parseIDL(new TextDecoder().decode(schema.data))));
    }
    types.add(schema.name);
    if (channel.topic !== lines[i].topic || String(m.logTime) !== String(lines[i].log_time_ns))
      fail(`${file}: message ${i} is ${channel.topic} at ${m.logTime}, ours ${lines[i].topic} at ${lines[i].log_time_ns}`);
    const differences = compare(lines[i].message, readers.get(schema.id).readMessage(m.data), channel.topic);
    if (differences.length > 0) fail(`${file}: message ${i}: ${differences.slice(0, 5).join("; ")}`);
  });
  console.log(JSON.stringify({
    messages: lines.length, types: [...types].sort(), chunks: Object.fromEntries(stream.chunks),
    attachments: index.attachments.sort(), metadata: index.metadata.sort(),
  }));
}

main().catch((e) => fail(`${process.argv[2]}: ${e.message}`));
