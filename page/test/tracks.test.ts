import { describe, expect, it } from "vitest";
import { Track, turnBetween } from "../src/data/tracks";

function track(rows: [us: number, x: number, heading: number, away: number, planned: number, fromUs: number][]): Track {
  const of = (k: number): number[] => rows.map((row) => row[k]!);
  return new Track(
    Float64Array.from(of(0)),
    Int32Array.from(of(1)),
    new Int32Array(rows.length),
    Int16Array.from(of(2)),
    Uint8Array.from(of(3)),
    Uint8Array.from(of(4)),
    (row) => of(5)[row]!,
  );
}

describe("a track", () => {
  it("moves in a straight line between key frames, rounded as the kernel does", () => {
    const way = track([[0, 0, 0, 0, 0, 0], [3e6, 10, 0, 0, 0, 3e6]]);
    expect([0, 1e6, 2e6, 3e6, 9e6].map((us) => way.poseAt(us).x)).toEqual([0, 3, 7, 10, 10]);
  });

  it("follows a broken-off movement only until it was replaced", () => {
    const way = track([
      [0, 0, 0, 0, 0, 0],
      [10e6, 100, 0, 0, 1, 5e6],
      [5e6, 50, 0, 0, 0, 5e6],
      [6e6, 40, 0, 0, 0, 6e6],
    ]);
    expect([4e6, 5e6, 6e6, 8e6].map((us) => way.poseAt(us).x)).toEqual([40, 50, 40, 40]);
  });

  it("turns the shorter way", () => {
    const way = track([[0, 0, 4000, 0, 0, 0], [4e6, 0, 96, 0, 0, 4e6]]);
    expect(way.poseAt(2e6).heading).toBe(0);
    expect(turnBetween(4000, 96)).toBe(192);
  });

  it("stands where it starts before its first key frame", () => {
    expect(track([[5e6, 7, 0, 0, 0, 5e6]]).poseAt(0).x).toBe(7);
  });

  it("leaves out stretches away in a way", () => {
    const way = track([[0, 0, 0, 0, 0, 0], [1e6, 9, 0, 1, 0, 1e6], [5e6, 9, 0, 0, 0, 5e6]]);
    expect(way.way(0, 4e6)).toEqual([0, 0]);
  });

  it("grows as a live run goes on", () => {
    const live = Track.none();
    for (let i = 0; i < 3000; i++) live.append(i * 1e6, { x: i, y: 0, heading: 0, away: false });
    expect(live.poseAt(1500.5e6).x).toBe(1501);
    expect(live.poseAt(9e12).x).toBe(2999);
  });
});
