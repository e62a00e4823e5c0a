"""`Described`: the frozen model behind every law and every part of a scene, and its errors in the user's words."""

import re
from typing import Annotated, Union, get_args

from pydantic import BaseModel, ConfigDict, Discriminator, Field, Tag, ValidationError, WrapValidator, model_validator
from pydantic_core import PydanticCustomError

from ..errors import SceneError, did_you_mean
from ..units import format_quantity, kind_of, refused, shown

_TAGS = ("kind", "law")
_SECOND = " "      # added to the word of a second description that has the same one


class _InTheUsersWords(type(BaseModel)):
    """Makes `Speed(velocty=…)` raise a `SceneError`; pydantic's own nested validation does not pass here."""

    def __call__(cls, /, **values):
        try:
            return super().__call__(**values)
        except ValidationError as error:
            raise scene_error(error, values) from None


class Described(BaseModel, metaclass=_InTheUsersWords):
    """A frozen description: keyword arguments only, no unknown keys, comparable and printable.

    Raises `SceneError` (key, what it got, what is allowed, what to try) for anything that cannot be meant.
    """

    model_config = ConfigDict(frozen=True, extra="forbid", populate_by_name=True, validate_default=False)

    @model_validator(mode="before")
    @classmethod
    def _keys_are_known(cls, values):
        if isinstance(values, cls):
            return values
        if not isinstance(values, dict):
            raise refused(values, "is not a table", f"a table with the keys {_listed(cls.key_names())}")
        unknown = [key for key in values if key not in cls._accepted_keys()]
        if unknown:
            raise PydanticCustomError("unknown_keys", "unknown keys", {"keys": unknown, "allowed": cls.key_names()})
        missing = [
            (field.alias or name, _expected(field))
            for name, field in cls.model_fields.items()
            if cls._requires(name, values) and name not in values and field.alias not in values
        ]
        if missing:
            raise PydanticCustomError("missing_keys", "missing keys", {"keys": missing})
        return values

    @classmethod
    def key_names(cls):
        """The keys as the user writes them, in order."""
        return [field.alias or name for name, field in cls.model_fields.items()]

    @classmethod
    def _requires(cls, name, values):
        """Whether a table needs the key, given its other ones."""
        return cls.model_fields[name].is_required()

    @classmethod
    def _accepted_keys(cls):
        return {*cls.model_fields, *cls.key_names()}

    @classmethod
    def read(cls, values):
        """The description from a table (nested dicts, as TOML gives them); raises `SceneError`."""
        try:
            return cls.model_validate(values)
        except ValidationError as error:
            raise scene_error(error, values) from None

    def replaced(self, **changes):
        """The same description with some keys changed, checked anew."""
        values = {name: getattr(self, name) for name in self.model_fields_set}
        return type(self)(**values | changes)

    def says(self, name):
        """Whether the user wrote the key, be it with its default."""
        return name in self.model_fields_set

    def as_table(self):
        """Nested dicts, lists and numbers in internal units, without the keys that keep their default."""
        table = {}
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if value is not None and (
                name in _TAGS or field.is_required() or value != field.get_default(call_default_factory=True)
            ):
                table[field.alias or name] = _plain(value)
        return table

    def __eq__(self, other):
        if type(self) is not type(other):
            return NotImplemented
        return all(getattr(self, name) == getattr(other, name) for name in type(self).model_fields)

    def __hash__(self):
        return hash((type(self), *(getattr(self, name) for name in type(self).model_fields)))

    def __repr__(self):
        words = []
        for name, field in type(self).model_fields.items():
            value = getattr(self, name)
            if name not in _TAGS and not is_default(value, field):
                words.append(f"{field.alias or name}={shown_with_unit(value, field)}")
        return f"{type(self).__name__}({', '.join(words)})"

    __str__ = __repr__


def is_default(value, field):
    """Whether the user could have left the key out."""
    return not field.is_required() and value == field.get_default(call_default_factory=True)


def shown_with_unit(value, field):
    """A field's value with its unit, or its `repr`."""
    kind = kind_of(field.annotation) or next(filter(None, map(kind_of, field.metadata)), None)
    if kind is not None and _is_numeric(value):
        return format_quantity(value, kind.unit)
    return repr(value)


def one_of(tag, *classes, base=None):
    """The union of descriptions told apart by their key `tag` ("kind" or "law"); instances of `base` also pass.

    Of several with the same word, that one is meant which knows most of the keys that are given.
    """
    names = [name for described in classes for name in get_args(described.model_fields[tag].annotation)]
    passing = (base,) if base else ()

    def check(value, inner):
        if isinstance(value, (*classes, *passing)):
            return value
        if not isinstance(value, dict):
            raise refused(value, "is not a table", f"a table such as {{ {tag} = '{names[0]}', … }}")
        if tag not in value:
            raise PydanticCustomError("missing_keys", "missing", {"keys": [(tag, f"one of {_listed(names)}")]})
        if value[tag] not in names:
            raise PydanticCustomError("unknown_word", "unknown", {"key": tag, "got": value[tag], "allowed": names})
        return inner(value)

    if len(set(names)) == len(names):
        return Annotated[Union[classes], Field(discriminator=tag), WrapValidator(check)]  # noqa: UP007
    labels = {described: f"{name}{_SECOND * names[:number].count(name)}"
              for number, (name, described) in enumerate(zip(names, classes, strict=True))}

    def label(value):
        if not isinstance(value, dict):
            return labels.get(type(value))
        same = [described for name, described in zip(names, classes, strict=True) if name == value[tag]]
        return labels[max(same, key=lambda described: len(described._accepted_keys() & value.keys()))]

    tagged = tuple(Annotated[described, Tag(text)] for described, text in labels.items())
    return Annotated[Union[tagged], Field(discriminator=Discriminator(label)), WrapValidator(check)]  # noqa: UP007


def scene_error(error, values):
    """The `SceneError` for a pydantic `ValidationError` on the table `values`."""
    return SceneError.joined([p for single in error.errors() for p in _problems(single, values)])


def _problems(single, values):
    where, kind, context = _key(single["loc"], values), single["type"], single.get("ctx", {})
    below = f"{where}." if where else ""
    if kind == "unknown_keys":
        for key in context["keys"]:
            yield unknown_word("is not a key here", key, context["allowed"], f"{below}{key}")
    elif kind == "missing_keys":
        for key, expected in context["keys"]:
            yield SceneError(f"is missing; expected {expected}", key=f"{below}{key}", allowed=expected)
    elif kind == "unknown_word":
        got, allowed = context["got"], context["allowed"]
        key = f"{below}{context['key']}" if context["key"] else where
        yield unknown_word(f"{shown(got)} is not known", got, allowed, key)
    elif kind == "refused":
        sentence = f"{context['got']} {context['why']}; expected {context['expected']}"
        yield SceneError(sentence, key=where, got=single["input"], allowed=context["expected"])
    elif kind == "at_key":
        key = f"{below}{context['key']}" if context["key"] else where
        yield SceneError(context["sentence"], key=key, got=context.get("got"), allowed=context.get("allowed"))
    elif kind == "literal_error":
        allowed = re.findall(r"'([^']*)'", context["expected"])
        yield unknown_word(f"{shown(single['input'])} is not known", single["input"], allowed, where)
    else:
        expected = _EXPECTED.get(kind, "something else")
        sentence = f"{shown(single['input'])} is not {expected}"
        yield SceneError(sentence, key=where, got=single["input"], allowed=expected)


_EXPECTED = {
    "string_type": "a text",
    "dict_type": "a table",
    "list_type": "a list",
    "tuple_type": "a list",
    "bool_type": "true or false",
    "int_type": "a whole number",
    "float_type": "a number",
}


def unknown_word(sentence, got, allowed, key):
    """A `SceneError` for a word that is none of `allowed`, with the nearest one as a proposal."""
    hint = did_you_mean(got, allowed) if isinstance(got, str) else ""
    sentence = (
        f"{sentence}; {hint} (allowed: {_listed(allowed)})" if hint else f"{sentence}; allowed: {_listed(allowed)}"
    )
    return SceneError(sentence, key=key, got=got, allowed=list(allowed))


def at_key(key, sentence, got=None, allowed=None):
    """A pydantic error for one key of the model that is being validated (raise it in a model validator)."""
    return PydanticCustomError(
        "at_key", "{sentence}", {"key": key, "sentence": sentence, "got": got, "allowed": allowed}
    )


def _key(location, values):
    """The dotted key: pydantic's location without the tags of unions, which the user never wrote as keys."""
    words, here, was_tag = [], values, False
    for step in location:
        tags = [here[t] for t in _TAGS if t in here] if isinstance(here, dict) else []
        if isinstance(step, str) and step.rstrip(_SECOND) in tags and not was_tag:
            was_tag = True
            continue
        was_tag = False
        if isinstance(here, dict) and isinstance(step, str) and step != "[key]" and not {step, f"{step}_"} & {*here}:
            continue                                            # the tag is in the library, not in the user's table
        if step != "[key]":
            words.append(str(step))
        here = _inside(here, step)
    return ".".join(words)


def _inside(here, step):
    if isinstance(here, dict):
        return here.get(step)
    return here[step] if isinstance(here, (list, tuple)) and isinstance(step, int) and step < len(here) else None


def _expected(field):
    kind = kind_of(field.annotation) or next(filter(None, map(kind_of, field.metadata)), None)
    return field.description or (kind.expected if kind else "a value")


def _listed(words):
    return ", ".join(str(word) for word in words) or "nothing"


def _is_numeric(value):
    if isinstance(value, tuple):
        return all(_is_numeric(component) for component in value)
    return isinstance(value, (int, float)) and not isinstance(value, bool)


def _plain(value):
    if isinstance(value, Described):
        return value.as_table()
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, (tuple, list)):
        return [_plain(item) for item in value]
    return value
