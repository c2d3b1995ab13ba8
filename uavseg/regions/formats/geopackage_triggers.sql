-- Of section F.3, with the names that GDAL gives them; they call functions that an editor of the file has.
-- {t} is the table, {g} its column of geometries, {bounds} are ST_MinX(NEW), ST_MaxX, ST_MinY and ST_MaxY.
CREATE TRIGGER "rtree_{t}_{g}_insert" AFTER INSERT ON "{t}"
    WHEN (new."{g}" NOT NULL AND NOT ST_IsEmpty(NEW."{g}"))
    BEGIN INSERT OR REPLACE INTO "rtree_{t}_{g}" VALUES (NEW."fid", {bounds}); END;
CREATE TRIGGER "rtree_{t}_{g}_update6" AFTER UPDATE OF "{g}" ON "{t}"
    WHEN OLD."fid" = NEW."fid" AND (NEW."{g}" NOTNULL AND NOT ST_IsEmpty(NEW."{g}"))
    AND (OLD."{g}" NOTNULL AND NOT ST_IsEmpty(OLD."{g}"))
    BEGIN UPDATE "rtree_{t}_{g}" SET minx = ST_MinX(NEW."{g}"), maxx = ST_MaxX(NEW."{g}"),
    miny = ST_MinY(NEW."{g}"), maxy = ST_MaxY(NEW."{g}") WHERE id = NEW."fid"; END;
CREATE TRIGGER "rtree_{t}_{g}_update7" AFTER UPDATE OF "{g}" ON "{t}"
    WHEN OLD."fid" = NEW."fid" AND (NEW."{g}" NOTNULL AND NOT ST_IsEmpty(NEW."{g}"))
    AND (OLD."{g}" ISNULL OR ST_IsEmpty(OLD."{g}"))
    BEGIN INSERT INTO "rtree_{t}_{g}" VALUES (NEW."fid", {bounds}); END;
CREATE TRIGGER "rtree_{t}_{g}_update2" AFTER UPDATE OF "{g}" ON "{t}"
    WHEN OLD."fid" = NEW."fid" AND (NEW."{g}" ISNULL OR ST_IsEmpty(NEW."{g}"))
    BEGIN DELETE FROM "rtree_{t}_{g}" WHERE id = OLD."fid"; END;
CREATE TRIGGER "rtree_{t}_{g}_update5" AFTER UPDATE ON "{t}"
    WHEN OLD."fid" != NEW."fid" AND (NEW."{g}" NOTNULL AND NOT ST_IsEmpty(NEW."{g}"))
    BEGIN DELETE FROM "rtree_{t}_{g}" WHERE id = OLD."fid";
    INSERT OR REPLACE INTO "rtree_{t}_{g}" VALUES (NEW."fid", {bounds}); END;
CREATE TRIGGER "rtree_{t}_{g}_update4" AFTER UPDATE ON "{t}"
    WHEN OLD."fid" != NEW."fid" AND (NEW."{g}" ISNULL OR ST_IsEmpty(NEW."{g}"))
    BEGIN DELETE FROM "rtree_{t}_{g}" WHERE id IN (OLD."fid", NEW."fid"); END;
CREATE TRIGGER "rtree_{t}_{g}_delete" AFTER DELETE ON "{t}" WHEN old."{g}" NOT NULL
    BEGIN DELETE FROM "rtree_{t}_{g}" WHERE id = OLD."fid"; END;
CREATE TRIGGER "trigger_insert_feature_count_{t}" AFTER INSERT ON "{t}"
    BEGIN UPDATE gpkg_ogr_contents SET feature_count = feature_count + 1
    WHERE lower(table_name) = lower('{t}'); END;
CREATE TRIGGER "trigger_delete_feature_count_{t}" AFTER DELETE ON "{t}"
    BEGIN UPDATE gpkg_ogr_contents SET feature_count = feature_count - 1
    WHERE lower(table_name) = lower('{t}'); END;
