import { beforeAll, describe, expect, it } from "vitest";
import { ask, completions } from "../src/data/ask";
import { AWAY } from "../src/data/rooms";
import type { Run } from "../src/data/run";
import { timeByValue, valueAt } from "../src/data/stretches";
import * as state from "../src/state";
import { held, wholeRun } from "./fixture";

let run: Run;
const SECOND = 1e6;
const HOUR = 3600 * SECOND;

beforeAll(async () => {
  run = await wholeRun();
  state.runs.value = [run];
});

const total = (question: string): number => ask(run, question, 0).spans.reduce((sum, span) => sum + span.to - span.from, 0);
const froms = (question: string): number[] => ask(run, question, 0).spans.map((span) => span.from / SECOND);

describe("a question", () => {
  it("finds the last sighting before a time in one answer", () => {
    const { first } = held.sightings[0]!;
    const before = first.filter((step) => step < 6 * 3600);
    expect(froms("last seen ana before 06:00")).toEqual(before.slice(-1));
    expect(froms("first seen ana after day 1 06:00")).toEqual(first.filter((step) => step >= 6 * 3600).slice(0, 1));
    expect(froms("Seen ana by astro")).toEqual(first);
  });

  it("finds when somebody was in a kind of room, as the lane says", () => {
    const bedrooms = run.facts.home.rooms.flatMap((room, i) => (room.type === "bedroom" ? [i] : []));
    const rooms = run.roomsOf("ana");
    const time = timeByValue(rooms, run.facts.home.rooms.length, run.endUs);
    expect(total("ana in bedroom")).toBe(bedrooms.reduce((sum, room) => sum + time[room]!, 0));
    expect(total("ana in bedroom") + total("ana not in bedroom")).toBe(run.endUs);
    for (const span of ask(run, "ana not in bedroom", 0).spans) expect(bedrooms).not.toContain(valueAt(rooms, span.from));
    expect(total("ana away")).toBe(time[time.length - 1]);
    expect(ask(run, "ana away", 0).spans.every((span) => valueAt(rooms, span.from) === AWAY)).toBe(true);
  });

  it("keeps what is longer or shorter than a time", () => {
    const all = ask(run, "ana in bathroom", 0).spans;
    const long = ask(run, "ana in bathroom > 5 min", 0).spans;
    const short = ask(run, "ana in bathroom < 5 min", 0).spans;
    expect(long.length).toBeGreaterThan(0);
    expect(long.length + short.length).toBe(all.length);
    expect(long.every((span) => span.to - span.from > 300 * SECOND)).toBe(true);
  });

  it("counts a night if it is so for more than half of it", () => {
    expect(ask(run, "nights ana in bedroom", 0).words).toBe("2 nights"); // the run begins and ends in one
    expect(ask(run, "nights ana not in bedroom", 0).words).toBe("never");
    expect(ask(run, "mornings ana not in bedroom", 0).words).toBe("1 morning");
    expect(ask(run, "nights astro away", 0).words).toBe("never");
  });

  it("tells who was where at a moment", () => {
    const us = 3 * HOUR;
    const room = run.facts.home.rooms[valueAt(run.roomsOf("ana"), us)!]!;
    expect(ask(run, "ana at 03:00", 0).words).toContain(`Ana is in ${run.home.labels[run.facts.home.rooms.indexOf(room)]}`);
    expect(ask(run, `${run.home.labels[run.facts.home.rooms.indexOf(room)]} at 5 Jan 03:00`, 0).words).toContain("Ana");
    expect(ask(run, `${room.type} at 3 h`, 0).spans[0]!.from).toBe(us);
  });

  it("finds every event by the words that are shown of it, in any order", () => {
    for (const row of run.events.rows) {
      const shown = `${row.event.replaceAll("_", " ")} ${row.entity}`;
      expect(froms(shown)).toContain(row.us / SECOND);
    }
    const asleep = run.events.rows.filter((row) => row.entity === "ana" && row.detail === "sleep");
    expect(froms("ana sleep")).toEqual(asleep.map((row) => row.us / SECOND));
  });

  it.each([
    ["ana in cellar", "no person, room, activity or event is called 'cellar'"],
    ["ana in kichen", "is called 'kichen'; did you mean 'kitchen'?"],
    ["anna in kitchen", "is called 'anna'; did you mean 'ana'?"],
    ["seen anna", "is called 'anna'; did you mean 'ana'?"],
    ["ana slep", "did you mean 'sleep'?"],
    ["ana not sleep", "'not' goes with rooms and 'seen'"],
    ["ana in bathroom > 20 minutes", "a length is written as > 20 min"],
    ["seen astro", "'seen by astro' is when astro sees somebody"],
    ["seen ana by ana", "only robots see"],
    ["ana differs", "compares two runs"],
    ["ana activity > 1 min sees", "is called 'sees'"],
    ["ana after lunch", "'lunch' is no time of this run"],
    ["kitchen at noonish", "'noonish' is no time of this run"],
    ["seen ana before never", "'never' is no time of this run"],
    ["last", "ask for something like"],
  ])("says why '%s' has no answer", (question, reason) => {
    expect(ask(run, question, 0)).toMatchObject({ spans: [] });
    expect(ask(run, question, 0).words).toContain(reason);
  });

  it("is completed by names, rooms and events", () => {
    expect(completions(run, "last seen a")).toContain("last seen ana");
    expect(completions(run, "ana in bath")).toContain("ana in bathroom");
    expect(completions(run, "")).toContain("nights");
  });

});

describe("‹ and ›", () => {
  it("step through the answers", () => {
    state.question.value = { text: "ana in bathroom", nearUs: 0 };
    state.goTo(0);
    state.jump(true);
    expect(state.moment.value).toBe(state.answer.value!.spans[0]!.from);
    state.jump(true);
    expect(state.moment.value).toBe(state.answer.value!.spans[1]!.from);
    state.jump(false);
    expect(state.moment.value).toBe(state.answer.value!.spans[0]!.from);
    state.question.value = null;
  });

  it("step through the events that were searched for", () => {
    state.search.value = "ana sleep";
    state.goTo(0);
    state.jump(true);
    expect(state.foundEvents.value.map((row) => row.us)).toContain(state.moment.value);
    expect(state.foundEvents.value.every((row) => row.entity === "ana")).toBe(true);
    state.search.value = "";
  });
});

describe("a question about two runs", async () => {
  const [run, other] = [await wholeRun(), await wholeRun()];
  const lane = other.roomsOf("ana");
  other.rooms.set("ana", { ...lane, value: [...lane.value].map((room, i) => (i === 3 ? room + 1 : room)) });

  it("finds where they differ", () => {
    const { spans } = ask(run, "first ana differs", 0, other);
    expect(spans.map((span) => [span.from, span.to])).toEqual([[lane.from[3], lane.to[3]]]);
    expect(ask(run, "astro differs", 0, other).words).toBe("never");
  });
});

describe("a question as people ask it", () => {
  const NEAR_US = 3 * HOUR;
  const said = (question: string): string => ask(run, question, NEAR_US).words;

  it("is the same as its short form", () => {
    expect(said("Where is Ana?")).toBe(said("ana at 03:00"));
    expect(said("where was ana at 06:30")).toBe(said("ana at 06:30"));
    expect(said("who is in bedroom")).toBe(said("bedroom at 03:00"));
    expect(said("ana now")).toBe(said("ana at 03:00"));
    expect(said("is ana in the bedroom?")).toMatch(/: (yes|no)$/);
    expect(froms("when did astro see ana?")).toEqual(froms("astro sees ana"));
    expect(froms("who saw ana")).toEqual(froms("seen ana"));
    expect(froms("when was ana in the bathroom?")).toEqual(froms("ana in bathroom"));
    expect(froms("both ana and astro in bedroom")).toEqual(froms("ana and astro in bedroom"));
  });

  it("about how long, how often and longest is counted from its stretches", () => {
    const spans = ask(run, "ana in bathroom", 0).spans;
    const lengths = spans.map(({ from, to }) => to - from);
    expect(said("how often was ana in the bathroom?")).toMatch(new RegExp(`^${spans.length} times?, `));
    expect(said("how long was ana in the bathroom?")).toContain(`; ${spans.length} time`);
    const [longest] = ask(run, "longest ana in bathroom", 0).spans;
    expect(longest!.to - longest!.from).toBe(Math.max(...lengths));
    const [shortest] = ask(run, "what was the shortest time that ana was in the bathroom", 0).spans;
    expect(shortest!.to - shortest!.from).toBe(Math.min(...lengths));
  });

  it("joins clauses that hold at the same time, or at any", () => {
    const both = total("ana in bedroom and astro in bedroom");
    expect(both).toBe(total("ana and astro in bedroom"));
    expect(total("ana in bedroom or astro in bedroom")).toBe(total("ana in bedroom") + total("astro in bedroom") - both);
    expect(total("ana in bedroom and not seen")).toBe(total("ana in bedroom and ana not seen"));
    expect(total("ana in bedroom and not seen") + total("ana in bedroom and seen")).toBe(total("ana in bedroom"));
  });

  it("says with whom somebody is", () => {
    const us = 3 * HOUR;
    const room = (name: string): number | null => valueAt(run.roomsOf(name), us);
    expect(said("who is with ana")).toContain(room("ana") === room("astro") ? "Astro" : "nobody");
  });

  it("is offered anew where one name is nearly right", () => {
    const wrong = ask(run, "where is anna", NEAR_US);
    expect(wrong.isUnderstood).toBe(false);
    expect(wrong.words).toContain("did you mean 'ana'");
    expect(wrong.meant).toBe("where is ana");
    expect(ask(run, "frobnicate", 0).meant).toBe("");
  });
});
