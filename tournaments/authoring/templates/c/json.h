/* A small JSON reader. It finds values in a text and copies nothing: a value is a pointer to its first character, or NULL where
   there is none. Texts are compared as they are written; escapes in them are not resolved. */
#ifndef JSON_H
#define JSON_H
#include <stdlib.h>
#include <string.h>

static inline const char *json_skip_space(const char *p) { return p + strspn(p, " \t\r\n"); }

/* Return what stands behind a value; NULL if it is torn. */
static inline const char *json_end(const char *value) {
    const char *p = value;
    int depth = 0;
    do {
        if (*p == '"') {
            for (p++; *p != '"'; p++)
                if (*p == '\0' || (*p == '\\' && *++p == '\0')) return NULL;
            p++;
        } else if (*p == '{' || *p == '[') {
            depth++, p++;
        } else if (*p == '}' || *p == ']') {
            depth--, p++;
        } else if (*p == '\0') {
            return NULL;
        } else if (depth > 0) {
            p++;
        } else {
            p += strcspn(p, ",:]} \t\r\n");
        }
    } while (depth > 0);
    return p > value ? p : NULL;
}

/* Return the first item of a list, or the first key of an object. */
static inline const char *json_first(const char *list) {
    if (list == NULL || (*list != '[' && *list != '{')) return NULL;
    const char *item = json_skip_space(list + 1);
    return *item == ']' || *item == '}' ? NULL : item;
}

/* Return the item, or the key, after the value of another. */
static inline const char *json_next(const char *value) {
    const char *p = json_end(value);
    if (p == NULL) return NULL;
    p = json_skip_space(p);
    return *p == ',' ? json_skip_space(p + 1) : NULL;
}

/* Return the value of a key of an object. */
static inline const char *json_get(const char *object, const char *key) {
    size_t length = strlen(key);
    const char *name = json_first(object);
    while (name != NULL && *name == '"') {
        const char *colon = json_end(name);
        if (colon == NULL || *(colon = json_skip_space(colon)) != ':') return NULL;
        const char *value = json_skip_space(colon + 1);
        if (strncmp(name + 1, key, length) == 0 && name[length + 1] == '"') return value;
        name = json_next(value);
    }
    return NULL;
}

static inline int json_int(const char *value) { return value == NULL ? 0 : (int)strtol(value, NULL, 10); }

/* Whether a value is written like this, as in json_is(value, "true") and json_is(value, "\"red\""). */
static inline int json_is(const char *value, const char *text) {
    return value != NULL && strncmp(value, text, strlen(text)) == 0 && json_end(value) == value + strlen(text);
}
#endif
