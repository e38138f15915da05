/** Furniture that was moved in a run: where its pieces are at a moment. */

import type { ObjectFacts } from "../contract";
import type { EventRow } from "./events";
import { lastAtMost } from "./search";

/** As `fleet2d.viewing.home_facts` reads it: the name of a piece, and where the middle of its box is from then on [m]. */
const MOVE = /^(.+) to \(([-\d.e+]+), ([-\d.e+]+)\)$/;

export class MovedObjects {
  private readonly us: number[] = [];
  /** What stands where from each of these moments on. */
  private readonly arrangements: (readonly ObjectFacts[])[] = [];

  constructor(
    private readonly first: readonly ObjectFacts[],
    rows: readonly EventRow[],
  ) {
    let objects = first;
    for (const { us, detail } of rows) {
      const [, name, x, y] = MOVE.exec(detail) ?? [];
      if (!objects.some((thing) => thing.name === name)) continue;
      objects = objects.map((thing) => (thing.name === name ? movedTo(thing, Number(x), Number(y)) : thing));
      this.us.push(us);
      this.arrangements.push(objects);
    }
  }

  /** The number of moves before a moment. */
  count(us: number): number {
    return lastAtMost(this.us, us) + 1;
  }

  at(us: number): readonly ObjectFacts[] {
    return this.arrangements[this.count(us) - 1] ?? this.first;
  }
}

function movedTo(thing: ObjectFacts, x: number, y: number): ObjectFacts {
  const xs = thing.outline.map(([px]) => px);
  const ys = thing.outline.map(([, py]) => py);
  const dx = x - (Math.min(...xs) + Math.max(...xs)) / 2;
  const dy = y - (Math.min(...ys) + Math.max(...ys)) / 2;
  const moved = ([px, py]: readonly [number, number]): [number, number] => [px + dx, py + dy];
  return { ...thing, outline: thing.outline.map(moved), middle: moved(thing.middle) };
}
