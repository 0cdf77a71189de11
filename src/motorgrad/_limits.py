"""Limits of what a file may hold: one table for all readers, as any file may be a stranger's.

A file of a few megabytes can stand for gigabytes, or keep a reader busy for hours. `motorgrad._reading` holds to these.
"""

MAX_NESTING_DEPTH = 100
"""Lists and tables within each other, in JSON, TOML and diagrams."""
MAX_INTEGER_DIGITS = 100
"""Digits of a whole number in JSON and TOML; a floating-point number has at most 309 before its point."""
MAX_KEY_PARTS = 30
"""Names in a dotted key of TOML, whose reader takes time with the third power of their number."""

MAX_SETTINGS_BYTES = 2**20
"""The size of a TOML file."""
MAX_BLOCK_SETTINGS_CHARACTERS = 100_000
"""The length of TOML in a block of a diagram."""
MAX_JSON_BYTES = 2**26
"""The size of a JSON file, and of a JSON text within another file."""
MAX_DIAGRAM_CHARACTERS = 50_000_000
MAX_DIAGRAM_SIGNALS = 2**22
"""Numbers at all ports of a diagram; a call of its program records up to 128 ticks of them."""
MAX_DIAGRAM_STATES = 2**26
"""Numbers in the states of all blocks of a diagram."""
MAX_JOURNAL_BYTES = 2**28
"""The size of the unsaved changes of a diagram."""

MAX_ZIP_ENTRIES = 10_000
"""Entries of a zip file, such as the arrays of an NPZ file."""
MAX_ARRAY_BYTES = 2**30
"""The arrays of a file that a study, a search or an experiment keeps, unpacked, and of a saved policy."""
MAX_MOTION_BYTES = 200 * 2**20
"""The size of a stored motion or trajectory, packed or not."""
MAX_MOTION_SECONDS = 10_000
"""The length of a motion that TimSim plays, of which it makes 100 frames a second."""
MAX_HEIGHT_MAP_BYTES = 2**30
MAX_ELEVATION_BYTES = 2**27
"""The size of a file with the elevation of ground."""
MAX_ELEVATION_POINTS = 2**22
"""Points of such a file, as many as 2048 × 2048."""
MAX_POLICY_SPARE_BYTES = 2**20
"""The size of an entry of a saved policy, beside the numbers that the policy has."""
MAX_FMU_BYTES = 2**30
"""The size of a Functional Mock-up Unit, packed or not."""
MAX_FMU_DESCRIPTION_BYTES = 2**26
"""The size of the description of a Functional Mock-up Unit, in XML."""

MAX_TABLE_BYTES = 2**30
"""The size of a table in CSV, Parquet or NPZ, packed or not; a number takes 8."""
MAX_TABLE_COLUMNS = 10_000
MAX_PARQUET_CHUNKS = 1_000_000
"""Columns times groups of rows."""
MAX_METRICS_BYTES = 2**32
"""All records of a run, unpacked, their list and the event files of TensorBoard."""
MAX_CHECKPOINT_BYTES = 2**32
"""The checkpoint of a run, which is read as a whole. A larger one is not saved."""
MAX_SIGNATURE_BYTES = 1_000
"""The signature of a run, and the file that says which process has the run."""

MAX_MODEL_BYTES = 2**30
"""The size of a model that MuJoCo compiles, and of each of its files."""
MAX_MODEL_CHARACTERS = 2**26
"""The length of a model's text, with all that it includes."""
MAX_MODEL_PARTS = 100_000
"""Parts of a model, with all copies."""
MAX_MODEL_COPIES = 2_000
"""Copies by one `replicate`, whose time grows with the square of their number; replicates may be nested."""
MAX_MODEL_ELEMENT_DEPTH = 500
"""Elements of XML within each other, about what MuJoCo reads."""
MAX_MODEL_FILE_DEPTH = 20
"""Files that include each other, or models within models."""
MAX_MODEL_RANGE_STEPS = 1_000_000
"""Steps of physics that find the range of an actuator's length."""
MAX_MODEL_RESERVED_BYTES = 2**33
"""Memory that MuJoCo reserves for contacts and constraints of each simulation, and touches as far as it uses it."""
MAX_MODEL_ARENA_BYTES = 2**31
"""The part of that memory which the contacts and constraints that are possible would use."""
MAX_MODEL_BODY_DEPTH = 1_000
"""Bodies within each other, about what MuJoCo can compile."""
MAX_MODEL_OCTREE_LEVELS = 8
MAX_DIAGRAM_MODEL_CHARACTERS = 1_000_000
"""The length of a model that is written in a diagram."""
MAX_FUNCTION_CHARACTERS = 100_000
"""The length of a Python function that is written in a diagram."""
