/** What bodies decided, why, and until when. */

import type { Table } from "./parquet";
import { lastAtMost } from "./search";

export interface DecisionRows {
  us: number[];
  /** The behavior that decided, and the last note of its plan, empty where there is none. */
  behavior: string[];
  reason: string[];
  /** When the body decides next if nothing interrupts its plan; NaN: never. */
  nextUs: number[];
}

export interface Decision {
  us: number;
  behavior: string;
  reason: string;
  nextUs: number;
}

export class Decisions {
  private readonly byName = new Map<string, DecisionRows>();

  of(name: string): DecisionRows | undefined {
    return this.byName.get(name);
  }

  /** The decision that a body follows at a moment. */
  at(name: string, us: number): Decision | null {
    const rows = this.byName.get(name);
    const i = rows ? lastAtMost(rows.us, us) : -1;
    if (!rows || i < 0) return null;
    const planned = rows.nextUs[i]!; // that moment may have passed: the behaviors kept to the plan
    const nextUs = planned > us ? planned : (rows.us[i + 1] ?? NaN);
    return { us: rows.us[i]!, behavior: rows.behavior[i]!, reason: rows.reason[i]!, nextUs };
  }

  /** Add a decision; one that equals the last one of the body is the same. */
  add(name: string, { us, behavior, reason, nextUs }: Decision): void {
    let rows = this.byName.get(name);
    if (!rows) this.byName.set(name, (rows = { us: [], behavior: [], reason: [], nextUs: [] }));
    const last = rows.us.length - 1;
    if (rows.behavior[last] === behavior && rows.reason[last] === reason && Object.is(rows.nextUs[last], nextUs)) return;
    rows.us.push(us);
    rows.behavior.push(behavior);
    rows.reason.push(reason);
    rows.nextUs.push(nextUs);
  }

  /** The decisions before a moment. */
  until(us: number): Decisions {
    const part = new Decisions();
    for (const [name, rows] of this.byName) {
      const count = lastAtMost(rows.us, us - 1) + 1;
      part.byName.set(name, {
        us: rows.us.slice(0, count),
        behavior: rows.behavior.slice(0, count),
        reason: rows.reason.slice(0, count),
        nextUs: rows.nextUs.slice(0, count),
      });
    }
    return part;
  }
}

export async function readDecisions(table: Table, stepUs: number): Promise<Decisions> {
  const decisions = new Decisions();
  const step = await table.numbers("step");
  const next = await table.numbers("next_step");
  const [entity, behavior, reason] = [await table.words("entity"), await table.words("behavior"), await table.words("reason")];
  for (let i = 0; i < step.length; i++) {
    decisions.add(entity.words[entity.codes[i]!]!, {
      us: step[i]! * stepUs,
      behavior: behavior.words[behavior.codes[i]!] ?? "",
      reason: reason.words[reason.codes[i]!] ?? "",
      nextUs: next[i]! * stepUs,
    });
  }
  return decisions;
}
