"""Limits of what a file may hold: one table for all readers, as any file may be a stranger's.

A file of a few megabytes can stand for gigabytes, or keep a reader busy for hours. `motorgrad._reading` holds to these.
"""

MOST_NESTED = 100
"""Lists and tables within each other, in JSON, TOML and diagrams."""
MOST_DIGITS = 100
"""Of a whole number in JSON and TOML; a floating-point number has at most 309 before its point."""
MOST_KEY_PARTS = 30
"""Names in a dotted key of TOML, whose reader takes time with the third power of their number."""

MOST_SETTINGS_BYTES = 2**20
"""Of a TOML file."""
MOST_BLOCK_SETTINGS = 100_000
"""Characters of TOML in a block of a diagram."""
MOST_JSON_BYTES = 2**26
"""Of a JSON file, and of a JSON text within another file."""
MOST_DIAGRAM_CHARACTERS = 50_000_000
MOST_DIAGRAM_SIGNALS = 2**22
"""Numbers at all ports of a diagram; a call of its program records up to 128 ticks of them."""
MOST_DIAGRAM_STATES = 2**26
"""Numbers in the states of all blocks of a diagram."""
MOST_JOURNAL_BYTES = 2**28
"""Of the unsaved changes of a diagram."""

MOST_ENTRIES = 10_000
"""Of a zip file, such as the arrays of an NPZ file."""
MOST_ARRAY_BYTES = 2**30
"""Of the arrays of a file that a study, a search or an experiment keeps, unpacked, and of a saved policy."""
MOST_MOTION_BYTES = 200 * 2**20
"""Of a stored motion or trajectory, packed or not."""
MOST_MOTION_SECONDS = 10_000
"""Of a motion that TimSim plays, of which it makes 100 frames a second."""
MOST_MAP_BYTES = 2**30
"""Of a map of heights."""
MOST_POLICY_SPARE_BYTES = 2**20
"""Of an entry of a saved policy, beside the numbers that the policy has."""
MOST_UNIT_BYTES = 2**30
"""Of a Functional Mock-up Unit, packed or not."""
MOST_UNIT_DESCRIPTION_BYTES = 2**26
"""Of the description of a Functional Mock-up Unit, in XML."""

MOST_TABLE_BYTES = 2**30
"""Of a table in CSV, Parquet or NPZ, packed or not; a number takes 8."""
MOST_TABLE_COLUMNS = 10_000
MOST_TABLE_PARTS = 1_000_000
"""Of a Parquet file: its columns times its groups of rows."""
MOST_METRICS_BYTES = 2**32
"""Of all records of a run, unpacked, of their list and of the event files of TensorBoard."""
MOST_STATE_BYTES = 2**32
"""Of a checkpoint of a run, which is read as a whole. A larger one is not saved."""
MOST_MARK_BYTES = 1_000
"""Of a run's signature, and of the file that says which process has it."""

MOST_MODEL_BYTES = 2**30
"""Of a model that MuJoCo compiles, and of each of its files."""
MOST_MODEL_TEXT = 2**26
"""Characters of a model with all that it includes."""
MOST_MODEL_PARTS = 100_000
"""With all copies."""
MOST_MODEL_COPIES = 2_000
"""By one `replicate`, whose time grows with the square of their number; replicates may be nested."""
MOST_MODEL_ELEMENTS_DEEP = 500
"""Elements of XML within each other, about what MuJoCo reads."""
MOST_MODEL_FILES_DEEP = 20
"""Files that include each other, or models within models."""
MOST_MODEL_RANGE_STEPS = 1_000_000
"""Of physics, to find the range of an actuator's length."""
MOST_MODEL_RESERVED_BYTES = 2**33
"""For contacts and constraints of each simulation: memory that MuJoCo reserves, and touches as far as it uses it."""
MOST_MODEL_ARENA_BYTES = 2**31
"""Of that, what the contacts and constraints that are possible would use."""
MOST_MODEL_BODIES_DEEP = 1_000
"""Bodies within bodies, about what MuJoCo can compile."""
MOST_MODEL_OCTREE_LEVELS = 8
MOST_MODEL_CHARACTERS = 1_000_000
"""Of a model that is written in a diagram."""
MOST_FUNCTION_CHARACTERS = 100_000
"""Of a Python function that is written in a diagram."""
