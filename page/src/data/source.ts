/** Where the page's data come from: the server, or the page's own file. */

import type { AsyncBuffer } from "hyparquet";
import type { NoteFacts, PostureFacts, Problem, RunFacts, SessionFacts, SightingFacts, WallsFacts } from "../contract";

const WHOLE_BYTES = 8_000_000;
const BLOCK_BYTES = 1 << 20;

export interface RunSource {
  /** The path of the run on the server; empty where there is no server. */
  readonly path: string;
  facts(): Promise<RunFacts>;
  sightings(): Promise<SightingFacts[]>;
  /** When people sit or lie; null where nobody knows yet. */
  postures(): Promise<PostureFacts | null>;
  notes(): Promise<NoteFacts[]>;
  storeNotes(notes: readonly NoteFacts[]): Promise<NoteFacts[]>;
  /** The key frames of all bodies as plain arrays; null where only their table is there. */
  tracks(): Promise<ArrayBuffer | null>;
  walls(number: number): Promise<WallsFacts>;
  table(name: string, bytes: number): Promise<AsyncBuffer>;
}

/** Everything of a run that a file holds which plays without a server. */
export interface EmbeddedRun {
  facts: RunFacts;
  sightings: SightingFacts[];
  postures: PostureFacts;
  walls: WallsFacts[];
  /** Parquet files by name, base64. */
  tables: Record<string, string>;
}

export interface Session {
  facts: SessionFacts;
  sources: RunSource[];
}

export const SERVER_GONE =
  "The server no longer answers: start fleet2d view again, and reload the page. What was read before is still shown.";

export async function fetched(url: string, init?: RequestInit): Promise<Response> {
  const response = await fetch(url, init).catch(() => {
    throw new Error(SERVER_GONE);
  });
  if (!response.ok) {
    const problem = (await response.json().catch(() => null)) as Problem | null;
    throw new Error(problem?.message ?? `${url}: ${response.status}`);
  }
  return response;
}

export async function json<T>(url: string): Promise<T> {
  return (await (await fetched(url)).json()) as T;
}

export class ServedRun implements RunSource {
  constructor(readonly path: string) {}

  facts(): Promise<RunFacts> {
    return json(`${this.path}/facts.json`);
  }

  sightings(): Promise<SightingFacts[]> {
    return json(`${this.path}/sightings.json`);
  }

  postures(): Promise<PostureFacts> {
    return json(`${this.path}/postures.json`);
  }

  notes(): Promise<NoteFacts[]> {
    return json(`${this.path}/notes.json`);
  }

  async storeNotes(notes: readonly NoteFacts[]): Promise<NoteFacts[]> {
    const headers = { "Content-Type": "application/json" };
    const response = await fetched(`${this.path}/notes`, { method: "POST", headers, body: JSON.stringify(notes) });
    return (await response.json()) as NoteFacts[];
  }

  async tracks(): Promise<ArrayBuffer> {
    return await (await fetched(`${this.path}/tracks.bin`)).arrayBuffer();
  }

  walls(number: number): Promise<WallsFacts> {
    return json(`${this.path}/walls/${number}.json`);
  }

  async table(name: string, bytes: number): Promise<AsyncBuffer> {
    const url = `${this.path}/tables/${encodeURIComponent(name)}.parquet`;
    if (bytes > WHOLE_BYTES) return rangedBuffer(url, bytes);
    return await (await fetched(url)).arrayBuffer();
  }
}

/** A file on the server of which only the parts that are read are fetched, each once. */
export function rangedBuffer(url: string, byteLength: number): AsyncBuffer {
  const blocks = new Map<number, Promise<ArrayBuffer>>();
  const block = (index: number): Promise<ArrayBuffer> => {
    let content = blocks.get(index);
    if (!content) {
      const first = index * BLOCK_BYTES;
      const last = Math.min(byteLength, first + BLOCK_BYTES) - 1;
      const headers = { Range: `bytes=${first}-${last}` };
      content = fetched(url, { headers }).then((response) => response.arrayBuffer());
      blocks.set(index, content);
      if (blocks.size > 64) blocks.delete(blocks.keys().next().value!);
    }
    return content;
  };
  return {
    byteLength,
    async slice(start: number, end: number = byteLength): Promise<ArrayBuffer> {
      const first = Math.floor(start / BLOCK_BYTES);
      const last = Math.floor((end - 1) / BLOCK_BYTES);
      const parts = await Promise.all(
        Array.from({ length: last - first + 1 }, (_, i) => block(first + i)),
      );
      const joined = new Uint8Array(end - start);
      parts.forEach((part, i) => {
        const at = (first + i) * BLOCK_BYTES - start;
        const from = Math.max(0, -at);
        const until = Math.min(part.byteLength, end - start - at);
        joined.set(new Uint8Array(part, from, until - from), at + from);
      });
      return joined.buffer;
    },
  };
}

/** A source of a run that has its poses in tables only, and nowhere to store notes. */
export abstract class TablesOnly {
  protected abstract readonly whyNoNotes: string;

  notes(): Promise<NoteFacts[]> {
    return Promise.resolve([]);
  }

  storeNotes(): Promise<never> {
    return Promise.reject(new Error(this.whyNoNotes));
  }

  tracks(): Promise<null> {
    return Promise.resolve(null);
  }
}

class HeldRun extends TablesOnly implements RunSource {
  readonly path = "";
  protected readonly whyNoNotes = "a file holds no notes: open the run with fleet2d view";

  constructor(private readonly held: EmbeddedRun) {
    super();
  }

  facts(): Promise<RunFacts> {
    return Promise.resolve(this.held.facts);
  }

  sightings(): Promise<SightingFacts[]> {
    return Promise.resolve(this.held.sightings);
  }

  postures(): Promise<PostureFacts> {
    return Promise.resolve(this.held.postures);
  }

  walls(number: number): Promise<WallsFacts> {
    const walls = this.held.walls[number];
    return walls ? Promise.resolve(walls) : Promise.reject(new Error("these walls are not in the file"));
  }

  table(name: string): Promise<AsyncBuffer> {
    const content = this.held.tables[name];
    if (content === undefined) return Promise.reject(new Error(`the file holds no table ${name}`));
    const bytes = Uint8Array.from(atob(content), (letter) => letter.charCodeAt(0));
    return Promise.resolve(bytes.buffer);
  }
}

/** What the page shows: the runs in its own file, else those of the server that it came from. */
export async function openSession(): Promise<Session> {
  const held = document.getElementById("fleet2d-runs");
  if (held?.textContent) {
    const runs = JSON.parse(held.textContent) as EmbeddedRun[];
    const titles = runs.map((run) => run.facts.title);
    return {
      facts: { runs: titles, live: [], version: runs[0]?.facts.version ?? "" },
      sources: runs.map((run) => new HeldRun(run)),
    };
  }
  const facts = await json<SessionFacts>("session.json");
  return { facts, sources: facts.runs.map((_, i) => new ServedRun(`run/${i}`)) };
}
