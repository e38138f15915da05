"""How much tests try: a part by default, all of it with FLEET2D_THOROUGH=1, before a release."""

import os

THOROUGH = os.environ.get("FLEET2D_THOROUGH") == "1"
