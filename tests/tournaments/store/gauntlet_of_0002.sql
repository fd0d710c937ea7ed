BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0002');
CREATE TABLE leagues (
	id INTEGER NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	hash VARCHAR(64) NOT NULL, 
	facts TEXT NOT NULL, 
	n_pairs INTEGER NOT NULL, 
	run_at FLOAT NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (name)
);
INSERT INTO "leagues" VALUES(1,'old','db7ee26e2c30fcbb6304842e2fb7a60c51b409c0123808778b5f6ce96f29509c','{"clock": {"bank_s": 10.0, "grace_s": 10.0, "turn_time_s": 1.0}, "entries": {"patrol": "patrol", "random": "random", "rush": "rush"}, "hero": "rush", "rules": "c2947cfb85c8c2dbdc4789e7bf06d23fe95024bfe9da0a39c14eb0466d75c9e0", "ruleset": "paper", "secret": "a6e3e5d2d0f4a470f009f38feb2c82b2e40b40178d22738dbc3395b576aa9e7b"}',1,1.79533444270177745816e+09);
CREATE TABLE matches (
	id INTEGER NOT NULL, 
	league_id INTEGER NOT NULL, 
	identity VARCHAR(300) NOT NULL, 
	blue VARCHAR(64) NOT NULL, 
	red VARCHAR(64) NOT NULL, 
	ending VARCHAR(16) NOT NULL, 
	winner VARCHAR(4), 
	score INTEGER NOT NULL, 
	ticks INTEGER NOT NULL, 
	reason TEXT NOT NULL, 
	seats TEXT NOT NULL, 
	PRIMARY KEY (id), 
	FOREIGN KEY(league_id) REFERENCES leagues (id), 
	UNIQUE (identity)
);
INSERT INTO "matches" VALUES(1,1,'old/random/rush/0000/random-blue/0','random','rush','elimination','blue',100,23,'','{"blue": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(2,1,'old/patrol/rush/0000/rush-blue/0','rush','patrol','capture','blue',100,21,'','{"blue": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(3,1,'old/random/rush/0000/rush-blue/0','rush','random','capture','blue',100,25,'','{"blue": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(4,1,'old/patrol/rush/0000/patrol-blue/0','patrol','rush','capture','red',-100,13,'','{"blue": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {}, "latency_p50_s": null, "latency_p99_s": null}}');
CREATE TABLE ladder_entries (
	id INTEGER NOT NULL, 
	ladder VARCHAR(64) NOT NULL, 
	"key" VARCHAR(64) NOT NULL, 
	name VARCHAR(64) NOT NULL, 
	mu DOUBLE NOT NULL, 
	sigma DOUBLE NOT NULL, 
	wins INTEGER NOT NULL, 
	draws INTEGER NOT NULL, 
	losses INTEGER NOT NULL, 
	forfeits INTEGER NOT NULL, 
	n_blue INTEGER NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (ladder, "key")
);
CREATE TABLE ladder_matches (
	id INTEGER NOT NULL, 
	ladder VARCHAR(64) NOT NULL, 
	identity VARCHAR(300) NOT NULL, 
	blue VARCHAR(64) NOT NULL, 
	red VARCHAR(64) NOT NULL, 
	blue_key VARCHAR(64) NOT NULL, 
	red_key VARCHAR(64) NOT NULL, 
	ending VARCHAR(16) NOT NULL, 
	winner VARCHAR(4), 
	score INTEGER NOT NULL, 
	ticks INTEGER NOT NULL, 
	reason TEXT NOT NULL, 
	rules VARCHAR(64) NOT NULL, 
	counted_at DOUBLE NOT NULL, 
	PRIMARY KEY (id), 
	UNIQUE (identity)
);
CREATE INDEX ix_matches_league_id ON matches (league_id);
COMMIT;
