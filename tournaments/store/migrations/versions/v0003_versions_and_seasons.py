"""Versions of entries, and the tables of seasons. Whatever a league has played so far was the first version of its entries."""

import json

import sqlalchemy as sa
from alembic import op

revision = "0003"
down_revision = "0002"


def upgrade() -> None:
    """Lay the tables, make room for labels, and enter the versions of leagues that are there."""
    for side in ("blue", "red"):
        if op.get_bind().dialect.name == "postgresql":  # SQLite does not mind how long a text is
            op.alter_column("matches", side, existing_type=sa.String(64), type_=sa.String(72), existing_nullable=False)
        op.create_index(f"ix_matches_{side}", "matches", ["league_id", side])
    versions = op.create_table(
        "versions",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("league_id", sa.Integer, sa.ForeignKey("leagues.id"), nullable=False),
        sa.Column("entry", sa.String(64), nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("fingerprint", sa.Text, nullable=False),
        sa.Column("entered_at", sa.Double, nullable=False),
        sa.Column("spec", sa.Text, nullable=False),
        sa.Column("rating", sa.Text),
        sa.UniqueConstraint("league_id", "entry", "number"),
    )
    op.create_table(
        "season_entries",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("league_id", sa.Integer, sa.ForeignKey("leagues.id"), nullable=False),
        sa.Column("entry", sa.String(64), nullable=False),
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("number", sa.Integer, nullable=False),
        sa.Column("is_withdrawn", sa.Boolean, nullable=False),
        sa.UniqueConstraint("league_id", "entry"),
    )
    op.create_table(
        "submissions",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("league_id", sa.Integer, sa.ForeignKey("leagues.id"), nullable=False, index=True),
        sa.Column("entry", sa.String(64), nullable=False),
        sa.Column("owner", sa.String(64), nullable=False),
        sa.Column("digest", sa.String(64), nullable=False),
        sa.Column("n_bytes", sa.Integer, nullable=False),
        sa.Column("received_at", sa.Double, nullable=False),
        sa.Column("state", sa.String(16), nullable=False),
        sa.Column("says", sa.Text, nullable=False),
        sa.Column("report", sa.Text),
        sa.Column("number", sa.Integer),
    )
    op.create_table(
        "season_standings",
        sa.Column("league_id", sa.Integer, sa.ForeignKey("leagues.id"), primary_key=True),
        sa.Column("made_at", sa.Double, nullable=False),
        sa.Column("document", sa.Text, nullable=False),
    )
    leagues = op.get_bind().execute(sa.text("SELECT id, facts, run_at FROM leagues")).all()
    rows = [
        {"league_id": league, "entry": entry, "number": 1, "fingerprint": fingerprint, "entered_at": run_at, "spec": ""}
        for league, facts, run_at in leagues
        for entry, fingerprint in json.loads(facts)["entries"].items()
    ]
    if rows:
        op.bulk_insert(versions, rows)
