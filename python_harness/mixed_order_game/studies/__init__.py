"""Studies: what takes several runs: claims judged, variants compared, gains sought, designs swept."""
