/** Stretches of time with words: their union, what they have in common, and the gaps between them. */

export interface Span {
  from: number;
  to: number;
  words: string;
}

/** The times in at least one of some lists; stretches that overlap or touch are one, and count once. */
export function union(lists: readonly (readonly Span[])[]): Span[] {
  const spans: Span[] = [];
  let words = new Set<string>();
  for (const span of lists.flat().sort((a, b) => a.from - b.from)) {
    const last = spans.at(-1);
    if (last && span.from <= last.to) {
      last.to = Math.max(last.to, span.to);
      last.words = [...words.add(span.words)].join(", ");
    } else {
      words = new Set([span.words]);
      spans.push({ ...span });
    }
  }
  return spans;
}

/** The times in both of two lists, each in order and without overlaps. */
export function intersection(some: readonly Span[], others: readonly Span[]): Span[] {
  const spans: Span[] = [];
  let begin = 0;
  for (const one of some) {
    while (begin < others.length && others[begin]!.to <= one.from) begin++;
    for (let i = begin; i < others.length && others[i]!.from < one.to; i++) {
      const other = others[i]!;
      const words = one.words === other.words ? one.words : `${one.words}, ${other.words}`;
      spans.push({ from: Math.max(one.from, other.from), to: Math.min(one.to, other.to), words });
    }
  }
  return spans;
}

/** The gaps that a list leaves between two moments. */
export function complement(spans: readonly Span[], from: number, to: number, words: string): Span[] {
  const gaps: Span[] = [];
  let at = from;
  for (const span of [...clipped(spans, from, to), { from: to, to, words }]) {
    if (span.from > at) gaps.push({ from: at, to: span.from, words });
    at = Math.max(at, span.to);
  }
  return gaps;
}

/** The parts of stretches between two moments; a moment stays if it is before the second one. */
export function clipped(spans: readonly Span[], from: number, to: number): Span[] {
  return spans
    .filter((span) => span.from < to && (span.to > from || span.from >= from))
    .map((span) => ({ ...span, from: Math.max(from, span.from), to: Math.min(to, span.to) }));
}

/** The time that stretches without overlaps fill between two moments. */
export function filled(spans: readonly Span[], from: number, to: number): number {
  return clipped(spans, from, to).reduce((sum, span) => sum + span.to - span.from, 0);
}
