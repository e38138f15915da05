"""Live runs: real people, robots and sensors in, other programs out, while the run goes on."""

from fleet2d.live.bridge import Bridge, LiveStep, Peer
from fleet2d.live.peers import from_iterator, open_peer, open_peers, to_function

__all__ = ["Bridge", "LiveStep", "Peer", "from_iterator", "open_peer", "open_peers", "to_function"]
