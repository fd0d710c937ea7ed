BEGIN TRANSACTION;
CREATE TABLE alembic_version (
	version_num VARCHAR(32) NOT NULL, 
	CONSTRAINT alembic_version_pkc PRIMARY KEY (version_num)
);
INSERT INTO "alembic_version" VALUES('0001');
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
INSERT INTO "leagues" VALUES(1,'autumn','4656fae700b8172971e9e0325e459b4915d8ed3581f60d1314361b43848bab68','{"clock": {"bank_s": 10.0, "grace_s": 10.0, "turn_time_s": 1.0}, "entries": {"patrol": "patrol", "roomba": "roomba", "rush": "rush"}, "rules": "c2947cfb85c8c2dbdc4789e7bf06d23fe95024bfe9da0a39c14eb0466d75c9e0", "ruleset": "paper", "secret": "a6d963305d6285ef2e1b8b4f83f20e46ce0a3f49d74dcc6b47d797b4ca95ce0d"}',2,1.79536595701380515097e+09);
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
INSERT INTO "matches" VALUES(1,1,'autumn/patrol/roomba/0000/patrol-blue/0','patrol','roomba','capture','red',-100,14,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(2,1,'autumn/patrol/roomba/0001/patrol-blue/0','patrol','roomba','capture','red',-100,34,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(3,1,'autumn/patrol/roomba/0000/roomba-blue/0','roomba','patrol','capture','blue',100,7,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(4,1,'autumn/patrol/roomba/0001/roomba-blue/0','roomba','patrol','capture','blue',100,34,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(5,1,'autumn/roomba/rush/0000/roomba-blue/0','roomba','rush','capture','red',-100,14,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(6,1,'autumn/roomba/rush/0001/roomba-blue/0','roomba','rush','capture','red',-100,17,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(7,1,'autumn/patrol/rush/0001/rush-blue/0','rush','patrol','elimination','red',-100,26,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(8,1,'autumn/patrol/rush/0000/rush-blue/0','rush','patrol','capture','blue',100,29,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(9,1,'autumn/roomba/rush/0000/rush-blue/0','rush','roomba','capture','blue',100,16,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(10,1,'autumn/roomba/rush/0001/rush-blue/0','rush','roomba','capture','blue',100,18,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(11,1,'autumn/patrol/rush/0001/patrol-blue/0','patrol','rush','capture','red',-100,16,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
INSERT INTO "matches" VALUES(12,1,'autumn/patrol/rush/0000/patrol-blue/0','patrol','rush','capture','red',-100,21,'','{"blue": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}, "red": {"faults": {"unreadable": 0}, "latency_p50_s": null, "latency_p99_s": null}}');
CREATE INDEX ix_matches_league_id ON matches (league_id);
COMMIT;
