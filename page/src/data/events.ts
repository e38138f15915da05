/** Events of a run, in order. */

import type { Clock } from "./clock";
import type { Table } from "./parquet";
import { firstAtLeast, lastAtMost } from "./search";

export interface EventRow {
  index: number;
  us: number;
  step: number;
  entity: string;
  event: string;
  user: string;
  detail: string;
}

export class Events {
  readonly us: number[] = [];
  readonly rows: EventRow[] = [];
  private readonly byKind = new Map<string, number[]>();

  add(step: number, us: number, entity: string, event: string, user: string, detail: string): void {
    const index = this.rows.length;
    this.us.push(us);
    this.rows.push({ index, us, step, entity, event, user, detail });
    const indices = this.byKind.get(event);
    if (indices) indices.push(index);
    else this.byKind.set(event, [index]);
  }

  get kinds(): string[] {
    return [...this.byKind.keys()].sort();
  }

  ofKind(kind: string): EventRow[] {
    return (this.byKind.get(kind) ?? []).map((index) => this.rows[index]!);
  }

  /** The number of events before a moment. */
  before(us: number): number {
    return firstAtLeast(this.us, us);
  }

  /** Index of the first event after a moment. */
  after(us: number): number {
    return lastAtMost(this.us, us) + 1;
  }

  /** The last event of an entity and kind up to a moment. */
  last(entity: string, kind: string, us: number): EventRow | null {
    for (let i = this.after(us) - 1; i >= 0; i--) {
      const row = this.rows[i]!;
      if (row.entity === entity && (!kind || row.event === kind)) return row;
    }
    return null;
  }
}

export async function readEvents(table: Table, clock: Clock): Promise<Events> {
  const events = new Events();
  const steps = await table.numbers("step");
  const entity = await table.words("entity");
  const event = await table.words("event");
  const user = table.has("user") ? await table.words("user") : null;
  const detail = await table.words("detail");
  for (let i = 0; i < steps.length; i++) {
    const word = (column: { codes: Int32Array; words: string[] } | null): string =>
      column ? (column.words[column.codes[i]!] ?? "") : "";
    events.add(steps[i]!, steps[i]! * clock.stepUs, word(entity), word(event), word(user), word(detail));
  }
  return events;
}
