/** How people ask: "where is Ana?", "how long was Ben in the kitchen?". Each form is one of the grammar's questions. */

/** What a question wants to know of the stretches that it is about. */
export type Wanted = "times" | "place" | "length" | "count" | "longest" | "shortest";

export interface Reading {
  wanted: Wanted;
  /** The question without what says what is wanted. */
  text: string;
}

const BE = "(?:is|are|was|were)";
const DO = "(?:is|are|was|were|does|did|do|has|have|had)";

/** Forms of questions, with what they want and how their rest is asked; the first that fits counts. */
const FORMS: readonly [form: RegExp, wanted: Wanted, rest: (rest: string) => string][] = [
  [new RegExp(`^where ${BE} (.+)$`, "i"), "place", (rest) => (isAboutSight(rest) ? rest : atMoment(rest))],
  [new RegExp(`^who (?:${BE} )?(?:seen|visible)\\b *(.*)$`, "i"), "times", (rest) => `seen ${rest}`],
  [/^who (?:sees|saw|has seen|found) (.+)$/i, "times", (rest) => `seen ${rest}`],
  [new RegExp(`^who ${BE} (.+)$`, "i"), "place", atMoment],
  [new RegExp(`^when (?:${DO} )?(.+)$`, "i"), "times", (rest) => rest],
  [new RegExp(`^how (?:long|much time) (?:${DO} )?(.+)$`, "i"), "length", withoutSpend],
  [new RegExp(`^how (?:often|many times) (?:${DO} )?(.+)$`, "i"), "count", withoutSpend],
  [new RegExp(`^(?:(?:what|which|when) ${BE} )?(?:the )?longest (?:time |stretch |stay )?(?:of |that |when )?(.+)$`, "i"), "longest", withoutBe],
  [new RegExp(`^(?:(?:what|which|when) ${BE} )?(?:the )?shortest (?:time |stretch |stay )?(?:of |that |when )?(.+)$`, "i"), "shortest", withoutBe],
  [/^(?:is|are) (.+)$/i, "place", atMoment],
  [/^(?:was|were|did|does|has) (.+)$/i, "times", (rest) => rest],
  [/^(.+) now$/i, "place", atMoment],
];

function isAboutSight(rest: string): boolean {
  return /\b(?:seen|see|sees|saw|found)\b/i.test(rest);
}

/** "ana" is asked as "ana at now". */
function atMoment(rest: string): string {
  const bare = rest.replace(/ (?:right )?now$/i, "");
  return / at \S/i.test(bare) ? bare : `${bare} at now`;
}

function withoutSpend(rest: string): string {
  return rest.replace(/\b(?:spend|spends|stay|stays)\b ?/i, "");
}

function withoutBe(rest: string): string {
  return rest.replace(new RegExp(`^${BE} `, "i"), "");
}

/**
 * Ways to read a question: first as people ask, then as it is, as somebody may be called "where".
 *
 * A sign of a question at the end has no meaning.
 */
export function readingsOf(question: string): Reading[] {
  const text = question.trim().replace(/\s*\?+$/, "");
  const asIs: Reading = { wanted: "times", text };
  for (const [form, wanted, rest] of FORMS) {
    const found = form.exec(text);
    if (found) return [{ wanted, text: rest(found[1]!).trim() }, asIs];
  }
  return [asIs];
}
