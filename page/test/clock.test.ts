import { describe, expect, it } from "vitest";
import { Clock, durationText } from "../src/data/clock";
import { ticks } from "../src/timeline/draw";

const clock = new Clock("2026-01-05T06:00:00", 1e6, 10 * 86_400);

// From 22:00 in Berlin on, over the night in which clocks are put back.
const changed = new Clock("2026-10-24T20:00:00", 1e6, 34 * 3600, [
  [0, 7200e6],
  [5 * 3600e6, 3600e6],
]);

describe("a clock that is changed", () => {
  it("reads an hour twice, with the offset", () => {
    expect(changed.text(4.5 * 3600e6)).toBe("Sun 25 Oct 02:30:00 +02:00");
    expect(changed.text(5.5 * 3600e6)).toBe("Sun 25 Oct 02:30:00 +01:00");
    expect(changed.hourAt(5.5 * 3600e6)).toBe(2.5);
  });

  it("has a day of 25 hours", () => {
    expect([changed.dayStart(2), changed.dayStart(3)]).toEqual([2 * 3600e6, 27 * 3600e6]);
    expect([changed.day(27 * 3600e6 - 1), changed.day(27 * 3600e6)]).toEqual([2, 3]);
  });

  it("goes to the same reading of the next day, 25 hours later", () => {
    expect(changed.dayOf(3 * 3600e6)).toEqual([2 * 3600e6, 27 * 3600e6]);
    expect(changed.daysLater(3 * 3600e6, 1)).toBe(28 * 3600e6);
    expect(changed.daysLater(28 * 3600e6, -1)).toBe(3 * 3600e6);
  });

  it.each([
    ["2026-10-25T02:30", 4.5 * 3600e6],
    ["day 2 03:00", 6 * 3600e6],
    ["Sun 25 Oct 07:00", 10 * 3600e6],
  ])("reads %s, the first of two", (text, us) => {
    expect(changed.parse(text)).toBe(us);
  });

  it("is exact in addresses, which may also name local time", () => {
    for (const hours of [4.5, 5.5]) expect(changed.ofStamp(changed.stampText(hours * 3600e6))).toBe(hours * 3600e6);
    expect(changed.stampText(5.5 * 3600e6)).toBe("2026-10-25T01:30:00Z");
    expect(changed.ofStamp("2026-10-25T02:30:00")).toBe(4.5 * 3600e6);
    expect(clock.ofStamp(clock.stampText(90e6))).toBe(90e6);
  });

  it("has ticks at round readings after the change, too", () => {
    const scale = { from: 3 * 3600e6, to: 15 * 3600e6, width: 1100 };
    const hours = Array.from({ length: 13 }, (_, hour) => `${String(hour).padStart(2, "0")}:00`);
    expect([...ticks(scale, changed)].map((us) => changed.timeText(us, false))).toEqual(hours);
  });

  it("has ticks of days at midnight before and after the change", () => {
    const scale = { from: 0, to: 34 * 3600e6, width: 140 };
    expect([...ticks(scale, changed)]).toEqual([-22 * 3600e6, 2 * 3600e6, 27 * 3600e6]);
  });

  it("goes past a gap", () => {
    const spring = new Clock("2026-03-28T23:00:00", 1e6, 10 * 3600, [
      [0, 3600e6],
      [2 * 3600e6, 7200e6],
    ]);
    expect([spring.parse("02:30", 3600e6), spring.parse("03:30", 3600e6)]).toEqual([2 * 3600e6, 2.5 * 3600e6]);
  });
});

describe("a clock", () => {
  it("writes local time, whatever the time zone of the browser", () => {
    expect(clock.text(30e6)).toBe("Mon 5 Jan 06:00:30");
    expect(clock.iso(0)).toBe("2026-01-05T06:00:00");
  });

  it("counts days by date", () => {
    expect([clock.day(0), clock.day(18 * 3600e6 - 1), clock.day(18 * 3600e6)]).toEqual([1, 1, 2]);
    expect(clock.dayStart(1)).toBe(-6 * 3600e6);
  });

  it.each([
    ["day 3 18:30", (2 * 24 + 12.5) * 3600e6],
    ["2026-01-05 07:00", 3600e6],
    ["2026-01-05T07:00:01", 3601e6],
    ["step 12", 12e6],
    ["day 2", 18 * 3600e6],
    ["Tue 6 Jan 07:00:30", (25 * 3600 + 30) * 1e6],
    ["6 january, 07:00", 25 * 3600e6],
    ["6 Jan 2026 7:00", 25 * 3600e6],
    ["2 d 14 h", (2 * 24 + 14) * 3600e6],
    ["90 min", 90 * 60e6],
  ])("reads %s", (text, us) => {
    expect(clock.parse(text)).toBe(us);
  });

  it("takes a time of day as that of the day shown", () => {
    expect(clock.parse("08:15", 20 * 3600e6)).toBe((18 + 8.25) * 3600e6);
  });

  it.each(["", "noon", "day 99", "25:00", "2027-01-01", "6 Foo 07:00", "31 Feb 07:00", "11 d"])("reads no moment from '%s'", (text) => {
    expect(clock.parse(text)).toBeNull();
  });

  it("writes durations in few words", () => {
    expect([durationText(5e6), durationText(95e6), durationText(3660e6), durationText(90_000e6)]).toEqual([
      "5 s",
      "1 min 35 s",
      "1 h 1 min",
      "1 d 1 h",
    ]);
  });
});
