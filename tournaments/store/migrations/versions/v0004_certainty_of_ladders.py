"""What a ladder's ratings grow old by: the version of each entry, and when it played last."""

import sqlalchemy as sa
from alembic import op

revision = "0004"
down_revision = "0003"


def upgrade() -> None:
    """Add both; entries that are there played last when their last match was counted."""
    op.add_column("ladder_entries", sa.Column("version", sa.String(64), nullable=False, server_default=""))
    op.add_column("ladder_entries", sa.Column("played_at", sa.Double, nullable=False, server_default="0"))
    op.execute(
        """
        UPDATE ladder_entries SET played_at = COALESCE((
            SELECT MAX(counted_at) FROM ladder_matches
            WHERE ladder_matches.ladder = ladder_entries.ladder
            AND (blue_key = ladder_entries.key OR red_key = ladder_entries.key)
        ), 0)
        """
    )
