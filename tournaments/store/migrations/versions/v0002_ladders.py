"""The tables of ladders: who is on one and how strong, and every match that was counted."""

import sqlalchemy as sa
from alembic import op

revision = "0002"
down_revision = "0001"


def upgrade() -> None:
    """Lay the tables."""
    op.create_table(
        "ladder_entries",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("ladder", sa.String(64), nullable=False),
        sa.Column("key", sa.String(64), nullable=False),
        sa.Column("name", sa.String(64), nullable=False),
        sa.Column("mu", sa.Double, nullable=False),
        sa.Column("sigma", sa.Double, nullable=False),
        sa.Column("wins", sa.Integer, nullable=False),
        sa.Column("draws", sa.Integer, nullable=False),
        sa.Column("losses", sa.Integer, nullable=False),
        sa.Column("forfeits", sa.Integer, nullable=False),
        sa.Column("n_blue", sa.Integer, nullable=False),
        sa.UniqueConstraint("ladder", "key"),
    )
    op.create_table(
        "ladder_matches",
        sa.Column("id", sa.Integer, primary_key=True),
        sa.Column("ladder", sa.String(64), nullable=False, index=True),
        sa.Column("identity", sa.String(300), nullable=False, unique=True),
        sa.Column("blue", sa.String(64), nullable=False),
        sa.Column("red", sa.String(64), nullable=False),
        sa.Column("blue_key", sa.String(64), nullable=False),
        sa.Column("red_key", sa.String(64), nullable=False),
        sa.Column("ending", sa.String(16), nullable=False),
        sa.Column("winner", sa.String(4)),
        sa.Column("score", sa.Integer, nullable=False),
        sa.Column("ticks", sa.Integer, nullable=False),
        sa.Column("reason", sa.Text, nullable=False),
        sa.Column("rules", sa.String(64), nullable=False),
        sa.Column("counted_at", sa.Double, nullable=False),
    )
