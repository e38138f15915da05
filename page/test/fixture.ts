import { readFileSync } from "node:fs";
import { Run } from "../src/data/run";
import type { EmbeddedRun, RunSource } from "../src/data/source";

export interface Expected {
  steps: number[];
  poses: Record<string, { x: number[]; y: number[]; heading: number[]; away: boolean[]; room: number[] }>;
  regions: { x: number; y: number; area: number }[];
}

const content = JSON.parse(readFileSync(new URL("run.json", import.meta.url), "utf-8")) as {
  run: EmbeddedRun;
  expected: Expected;
};

export const held = content.run;
export const expected = content.expected;

export const source: RunSource = {
  path: "",
  notes: () => Promise.resolve([]),
  storeNotes: () => Promise.resolve([]),
  tracks: () => Promise.resolve(null),
  facts: () => Promise.resolve(structuredClone(held.facts)),
  sightings: () => Promise.resolve(held.sightings),
  postures: () => Promise.resolve(held.postures),
  walls: (number) => Promise.resolve(held.walls[number]!),
  table: (name) => {
    const bytes = Buffer.from(held.tables[name]!, "base64");
    return Promise.resolve(bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength) as ArrayBuffer);
  },
};

export async function wholeRun(): Promise<Run> {
  const run = await Run.open(source);
  await run.readPoses();
  await run.readRest();
  return run;
}
