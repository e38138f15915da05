"""How right what is believed about presence is: distances, scores, and the metrics made of them."""
