"""Run cards: the trial on paper, one page for every run, to be read and written on at the bridge."""

from expdesign.export.cards.card import cards_html
