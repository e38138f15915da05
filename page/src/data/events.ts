/** Events of a run, in order. */

import type { EventKind } from "../contract";
import type { Clock } from "./clock";
import type { Table, Words } from "./parquet";
import { firstAtLeast, lastAtMost } from "./search";

export interface EventRow {
  index: number;
  us: number;
  step: number;
  entity: string;
  /** Behaviors of users record others, too, which the page only shows. */
  event: EventKind;
  user: string;
  detail: string;
  /** Which of the different texts of events it has: few of them recur all the time. */
  text: number;
}

/** What an event says, without when. */
export type EventText = Pick<EventRow, "entity" | "event" | "user" | "detail">;

export class Events {
  readonly us: number[] = [];
  readonly rows: EventRow[] = [];
  private readonly byKind = new Map<EventKind, number[]>();
  private readonly byEntity = new Map<string, number[]>();
  private readonly byBoth = new Map<string, number[]>();
  /** The different texts of events. */
  readonly texts: EventText[] = [];
  private readonly byText = new Map<string, number>();

  add(step: number, us: number, entity: string, event: string, user: string, detail: string, text = this.textOf(entity, event, user, detail)): void {
    const index = this.rows.length;
    this.us.push(us);
    const kind = event as EventKind;
    this.rows.push({ index, us, step, entity, event: kind, user, detail, text });
    file(this.byKind, kind, index);
    file(this.byEntity, entity, index);
    file(this.byBoth, `${entity}/${event}`, index);
    if (user && user !== entity) file(this.byEntity, user, index);
  }

  /** The number of a text. */
  textOf(entity: string, event: string, user: string, detail: string): number {
    const key = `${entity}/${event}/${user}/${detail}`;
    let number = this.byText.get(key);
    if (number === undefined) {
      number = this.texts.push({ entity, event: event as EventKind, user, detail }) - 1;
      this.byText.set(key, number);
    }
    return number;
  }

  get kinds(): EventKind[] {
    return [...this.byKind.keys()].sort();
  }

  has(kind: EventKind): boolean {
    return this.byKind.has(kind);
  }

  ofKind(kind: EventKind): EventRow[] {
    return this.rowsAt(this.byKind.get(kind));
  }

  /** The number of events before a moment. */
  before(us: number): number {
    return firstAtLeast(this.us, us);
  }

  /** Index of the first event after a moment. */
  after(us: number): number {
    return lastAtMost(this.us, us) + 1;
  }

  /** The kinds of events that happen to an entity. */
  kindsOf(entity: string): EventKind[] {
    return this.kinds.filter((kind) => this.byBoth.has(`${entity}/${kind}`));
  }

  /** The events that happen to an entity or are about it. */
  about(name: string): EventRow[] {
    return this.rowsAt(this.byEntity.get(name));
  }

  ofEntity(entity: string): EventRow[] {
    return this.about(entity).filter((row) => row.entity === entity);
  }

  of(entity: string, kind: EventKind): EventRow[] {
    return this.rowsAt(this.byBoth.get(`${entity}/${kind}`));
  }

  /** The last event of an entity and kind up to a moment. */
  last(entity: string, kind: EventKind, us: number): EventRow | null {
    const indices = this.byBoth.get(`${entity}/${kind}`) ?? [];
    const index = indices[lastAtMost(indices, this.after(us) - 1)];
    return index === undefined ? null : this.rows[index]!;
  }

  private rowsAt(indices: readonly number[] = []): EventRow[] {
    return indices.map((index) => this.rows[index]!);
  }
}

function file<Key>(index: Map<Key, number[]>, key: Key, row: number): void {
  const rows = index.get(key);
  if (rows) rows.push(row);
  else index.set(key, [row]);
}

/** An event in words, without who and when. */
export function shownText(row: EventText): string {
  return [row.event, row.user, row.detail].filter(Boolean).join(" ").replaceAll("_", " ");
}

export async function readEvents(table: Table, clock: Clock): Promise<Events> {
  const events = new Events();
  const steps = await table.numbers("step");
  const entity = await table.words("entity");
  const event = await table.words("event");
  const user = table.has("user") ? await table.words("user") : null;
  const detail = await table.words("detail");
  const columns = [entity, event, user, detail];
  const textOfCodes = new Map<number, number>();
  for (let i = 0; i < steps.length; i++) {
    const word = (column: Words | null): string => (column ? (column.words[column.codes[i]!] ?? "") : "");
    const words = [word(entity), word(event), word(user), word(detail)] as const;
    const code = columns.reduce((sum, column) => (column ? sum * (column.words.length + 1) + column.codes[i]! + 1 : sum), 0);
    let text = textOfCodes.get(code);
    if (text === undefined) textOfCodes.set(code, (text = events.textOf(...words)));
    events.add(steps[i]!, steps[i]! * clock.stepUs, ...words, text);
  }
  return events;
}
