"""Where alembic meets the store: on the connection of `tournaments.store.migrations.upgrade`, inside its transaction."""

from alembic import context

from tournaments.store.schema import METADATA

context.configure(connection=context.config.attributes["connection"], target_metadata=METADATA)
with context.begin_transaction():
    context.run_migrations()
