/** What the calendar shows of each person: activities, or rooms where a run has none; and when a robot saw them. */

import { kindOf, OUT } from "../data/activities";
import { AWAY } from "../data/rooms";
import type { Run } from "../data/run";
import { lastAtMost } from "../data/search";
import type { Stretches } from "../data/stretches";
import { doing } from "../data/words";
import { colors } from "../theme";

/** A strip of each day: the colour and the words of a stretch by its value. */
export interface Strip {
  name: string;
  stretches: Stretches;
  color: (value: number) => string;
  words: (value: number) => string;
  /** What the colours stand for. */
  legend: readonly (readonly [string, string])[];
  seen: Stretches;
}

export function stripsOf(run: Run): Strip[] {
  return run.bodies
    .filter((body) => !body.robot)
    .map(({ name }) => {
      const rows = run.events.of(name, "activity");
      const strip = rows.length > 0 ? activityStrip(run, name) : roomStrip(run, name);
      return { name, ...strip, seen: run.seen(name) };
    });
}

type Shown = Pick<Strip, "stretches" | "color" | "words" | "legend">;

/** Activities, and being out, which hides them. */
function activityStrip(run: Run, name: string): Shown {
  const rows = run.events.of(name, "activity");
  const rooms = run.roomsOf(name);
  const words = [...new Set(rows.map((row) => row.detail))];
  const code = new Map(words.map((word, i) => [word, i]));
  const out = words.length;
  const from: number[] = [];
  const to: number[] = [];
  const value: number[] = [];
  const push = (begin: number, end: number, what: number): void => {
    if (end <= begin) return;
    from.push(begin);
    to.push(end);
    value.push(what);
  };
  const gone = [...rooms.value].flatMap((room, i) => (room === AWAY ? [[rooms.from[i]!, rooms.to[i]!] as const] : []));
  rows.forEach((row, i) => {
    let begin = row.us;
    const end = rows[i + 1]?.us ?? run.presentUs;
    for (const [left, back] of gone) {
      if (back <= begin || left >= end) continue;
      push(begin, left, code.get(row.detail)!);
      push(Math.max(begin, left), Math.min(end, back), out);
      begin = Math.min(end, back);
    }
    push(begin, end, code.get(row.detail)!);
  });
  const shown = [...new Set(value)].filter((what) => what !== out).sort((a, b) => a - b).map((what) => kindOf(words[what]!));
  const kinds = new Map(shown.map((kind) => [kind.name, kind.color]));
  if (gone.length > 0) kinds.set(OUT.name, colors.value.hatch);
  return {
    stretches: { from, to, value },
    color: (what) => (what === out ? colors.value.hatch : kindOf(words[what]!).color),
    words: (what) => (what === out ? "out of home" : doing(words[what]!)),
    legend: [...kinds],
  };
}

function roomStrip(run: Run, name: string): Shown {
  const { rooms } = run.facts.home;
  const stretches = run.roomsOf(name);
  const been = [...new Set(stretches.value)].sort((a, b) => a - b);
  const color = (room: number): string => rooms[room]?.deep_color ?? colors.value.hatch;
  const words = (room: number): string => (room === AWAY ? "out of home" : run.home.labels[room]!);
  return { stretches, color, words, legend: been.map((room) => [words(room), color(room)]) };
}

/** The time within two moments that stretches take [us]. */
export function timeWithin({ from, to }: Stretches, begin: number, end: number): number {
  let time = 0;
  for (let i = Math.max(0, lastAtMost(from, begin)); i < from.length && from[i]! < end; i++) {
    time += Math.max(0, Math.min(end, to[i]!) - Math.max(begin, from[i]!));
  }
  return time;
}
