/** What the run comes to in a few numbers, each with its days. */

import { useSignal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { DAY_US } from "../data/clock";
import { numberColumns, readSeries } from "../data/metrics";
import type { Run } from "../data/run";
import { lastAtMost } from "../data/search";
import { timeWithin } from "../timeline/days";

const MOST_POINTS = 60;

interface Tile {
  words: string;
  value: string;
  unit: string;
  days: readonly number[];
}

export function Tiles({ run }: { run: Run }) {
  void run.version.value;
  const error = useSignal<Tile | null>(null);
  useEffect(() => {
    void run.attempt(async () => {
      error.value = await errorTile(run);
    });
  }, [run]);
  if (!run.isRead.value) return null;
  const tiles = [seenTile(run), error.value, requestTile(run), searchTile(run)].filter((tile) => tile !== null);
  if (tiles.length === 0) return null;
  return (
    <section class="tiles" aria-label={`${run.facts.title} in numbers`}>
      {tiles.map((tile) => (
        <div key={tile.words} class="tile">
          <span>{tile.words}</span>
          <strong>
            {tile.value} <small>{tile.unit}</small>
          </strong>
          <Sparkline values={tile.days} />
        </div>
      ))}
    </section>
  );
}

function Sparkline({ values }: { values: readonly number[] }) {
  const most = Math.max(...values, 1e-9);
  const x = (i: number): string => ((60 * i) / Math.max(1, values.length - 1)).toFixed(1);
  const points = values.map((value, i) => `${x(i)},${(20 - (18 * value) / most).toFixed(1)}`).join(" ");
  if (values.length < 2) return null;
  return (
    <svg class="sparkline" viewBox="0 0 60 22" height="22" preserveAspectRatio="none" aria-hidden="true">
      <polyline points={points} fill="none" stroke="currentColor" stroke-width="1.4" vector-effect="non-scaling-stroke" />
    </svg>
  );
}

/** The first and the last moment of each day of a run. */
function daysOf({ clock, beginUs, endUs }: Run): [number, number][] {
  const first = clock.day(beginUs);
  const count = clock.day(Math.max(beginUs, endUs - 1)) - first + 1;
  return Array.from({ length: Math.min(count, 400) }, (_, i) => clock.dayOf(clock.dayStart(first + i)));
}

function seenTile(run: Run): Tile | null {
  const people = run.bodies.filter((body) => !body.robot);
  if (run.sightings.length === 0) return null;
  const days = daysOf(run).map(([begin, end]) => people.reduce((sum, { name }) => sum + timeWithin(run.seen(name), begin, end), 0) / 3600e6);
  const total = days.reduce((sum, hours) => sum + hours, 0);
  const length = (run.endUs - run.beginUs) / DAY_US;
  return { words: "People in view", value: (total / Math.max(length, 1 / 24)).toFixed(1), unit: "h a day", days };
}

/** The share of time that a belief has in wrong rooms: the last of the first metric that says so. */
async function errorTile(run: Run): Promise<Tile | null> {
  for (const facts of run.facts.tables) {
    if (facts.role !== "metric" || facts.rows === 0 || !numberColumns(facts).includes("tv")) continue;
    const table = await run.open(facts.name);
    const [series] = table ? await readSeries(facts, table, run.clock.stepUs, "tv") : [];
    if (!series || series.values.length === 0) continue;
    const every = Math.max(1, Math.floor(series.values.length / MOST_POINTS));
    const days = Array.from(series.values).filter((value, i) => i % every === 0 && !Number.isNaN(value));
    const last = series.values[series.values.length - 1]!;
    return { words: "Belief wrong", value: (100 * last).toFixed(0), unit: "% of the time", days };
  }
  return null;
}

function requestTile(run: Run): Tile | null {
  const asked = run.events.ofKind("asks");
  const accepted = run.events.ofKind("accepted").map((row) => row.us);
  if (asked.length === 0) return null;
  const days = daysOf(run).map(([begin, end]) => lastAtMost(accepted, end) - lastAtMost(accepted, begin));
  return { words: "Requests accepted", value: String(accepted.length), unit: `of ${asked.length} asked`, days };
}

function searchTile(run: Run): Tile | null {
  const searches = run.events.ofKind("find_begins");
  const found = run.events.ofKind("found").map((row) => row.us);
  if (searches.length === 0) return null;
  const days = daysOf(run).map(([begin, end]) => lastAtMost(found, end) - lastAtMost(found, begin));
  return { words: "Believed found", value: String(found.length), unit: `of ${searches.length} searches`, days };
}
