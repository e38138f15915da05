/** Results of metrics, of the user's own, too. */

import { expect, test } from "vitest";
import { flat } from "../src/data/metrics";

test.each<[unknown, [string, string][]]>([
  [{ share: 0.123456 }, [["share", "0.1235"]]],
  [{ count: 12 }, [["count", "12"]]],
  [{ error: "nan", size: null, text: "late" }, [["error", "nan"], ["size", "–"], ["text", "late"]]],
  [{ ana: { rooms: [1, { a: true }] } }, [["ana · rooms · 0", "1"], ["ana · rooms · 1 · a", "true"]]],
  [{ ana: {}, ben: [] }, [["ana", "empty"], ["ben", "empty"]]],
  [{}, []],
  ["alone", [["", "alone"]]],
])("%j", (result, rows) => {
  expect(flat(result)).toEqual(rows);
});

test("a long text is cut, and says so", () => {
  expect(flat({ log: "x".repeat(500) })).toEqual([["log", `${"x".repeat(59)}…`]]);
});
