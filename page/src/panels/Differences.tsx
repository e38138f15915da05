/** What two runs differ in, so far or at their end. */

import type { MarkFacts } from "../contract";
import { durationText } from "../data/clock";
import { flat } from "../data/metrics";
import type { Run } from "../data/run";
import { differences, timeByWord } from "../data/stretches";
import { title } from "../data/words";
import * as state from "../state";
import { timeWithin } from "../timeline/days";

interface Row {
  words: string;
  values: readonly string[];
  /** The moment that a click shows; null: none. */
  us: number | null;
}

const HOUR_US = 3600e6;

export function Differences() {
  const [one, other] = state.runs.value;
  if (!one || !other) return null;
  void [one.version.value, other.version.value];
  const end = Math.min(one.presentUs, other.presentUs, one.endUs, other.endUs);
  const isOver = one.knownUs === Infinity && other.knownUs === Infinity;
  const rows = rowsOf(one, other, end).filter(({ values }) => values[0] !== values[1]);
  return (
    <section class="differences">
      <h2>What differs{isOver ? "" : ", so far"}</h2>
      {rows.length === 0 ? (
        <p class="hint">Nothing {isOver ? "does" : "until now"}: everybody is where the other run has them, and all numbers are the same.</p>
      ) : (
        <table>
          <thead>
            <tr>
              <th scope="col">
                <span class="visually-hidden">What</span>
              </th>
              {[one, other].map((run) => (
                <th key={run.facts.title} scope="col">
                  {run.facts.title}
                </th>
              ))}
            </tr>
          </thead>
          <tbody>
            {rows.map(({ words, values, us }) => (
              <tr key={words}>
                <th scope="row">
                  {us === null ? (
                    words
                  ) : (
                    <button type="button" class="link" onClick={() => state.goTo(us)}>
                      {words}
                    </button>
                  )}
                </th>
                {values.map((value, i) => (
                  <td key={i} class="number">
                    {value}
                  </td>
                ))}
              </tr>
            ))}
          </tbody>
        </table>
      )}
    </section>
  );
}

function rowsOf(one: Run, other: Run, end: number): Row[] {
  const both = [one, other];
  return [...apartRows(one, other, end), ...verdictRows(both), ...countRows(both, end), ...metricRows(both)];
}

/** Who is elsewhere, from when on and for how long. */
function apartRows(one: Run, other: Run, end: number): Row[] {
  return one.bodies.flatMap(({ name }) => {
    const apart = differences(one.roomsOf(name), other.roomsOf(name));
    const time = timeByWord(apart, () => "apart", 0, end).get("apart") ?? 0;
    const from = apart.from[0];
    if (time === 0 || from === undefined) return [];
    return [{ words: `${one.label(name)} elsewhere`, values: [`from ${one.clock.text(from).slice(4, -3)}`, durationText(time)], us: from }];
  });
}

function verdictRows(runs: readonly Run[]): Row[] {
  const outcomes = runs.map((run) => new Map(run.facts.verdicts.map(({ name, outcome }) => [name, outcome as string])));
  const names = [...new Set(outcomes.flatMap((ofRun) => [...ofRun.keys()]))];
  return names.map((name) => ({ words: title(name), values: outcomes.map((ofRun) => ofRun.get(name) ?? "–"), us: null }));
}

function countRows(runs: readonly Run[], end: number): Row[] {
  const kinds = [
    ["Requests asked", "asks"],
    ["Requests accepted", "accepted"],
    ["Searches it believes found", "found"],
    ["Ways blocked", "way_blocked"],
  ] as const;
  const seen = runs.map((run) => run.bodies.reduce((sum, { name, robot }) => (robot ? sum : sum + timeWithin(run.seen(name), 0, end)), 0));
  const counts = kinds.map(([words, kind]) => ({
    words,
    values: runs.map((run) => String(run.events.ofKind(kind).filter(({ us }) => us < end).length)),
    us: null,
  }));
  return [{ words: "People in view", values: seen.map((us) => `${(us / HOUR_US).toFixed(1)} h`), us: null }, ...counts];
}

/** Numbers that metrics put out at the end, where both runs have them. */
function metricRows(runs: readonly Run[]): Row[] {
  const values = runs.map((run) => new Map(flat(run.facts.metrics)));
  if (values.some((ofRun) => ofRun.size === 0)) return [];
  const names = [...new Set(values.flatMap((ofRun) => [...ofRun.keys()]))];
  return names.map((name) => ({ words: name.replaceAll("_", " "), values: values.map((ofRun) => ofRun.get(name) ?? "–"), us: null }));
}

/** What was done in a run and not in the others, as chips. */
export function Changes({ run }: { run: Run }) {
  void run.version.value;
  const key = ({ step, label }: MarkFacts): string => `${step} ${label}`;
  const others = state.runs.value.filter((entry) => entry !== run);
  const known = new Set(others.flatMap((entry) => entry.facts.marks).filter(({ kind }) => kind === "intervention").map(key));
  const own = run.facts.marks.filter((mark) => mark.kind === "intervention" && !known.has(key(mark)));
  if (own.length === 0) return null;
  return (
    <ul class="chips" aria-label={`Changed in ${run.facts.title}`}>
      {own.map((mark) => (
        <li key={key(mark)}>
          <button type="button" title={run.clock.text(mark.step * run.clock.stepUs)} onClick={() => state.goTo(mark.step * run.clock.stepUs)}>
            {mark.label.replaceAll("_", " ")}
          </button>
        </li>
      ))}
    </ul>
  );
}
